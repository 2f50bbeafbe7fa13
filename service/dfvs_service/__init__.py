"""The service that flies: its processes, their adapters and command lines."""
