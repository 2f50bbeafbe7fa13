"""Test harness: the real service beside a simulated vehicle and camera, which can be disturbed."""
