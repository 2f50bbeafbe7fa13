"""The benchmark's tasks flown by the simulated vehicle through the real service."""
