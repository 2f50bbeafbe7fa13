"""Perception run again on a recorded flight."""
