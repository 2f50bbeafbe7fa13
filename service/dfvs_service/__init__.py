"""Service that flies: its processes, adapters and command lines."""
