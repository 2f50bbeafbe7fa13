"""Fault matrix, fuzzing and soak runs."""
