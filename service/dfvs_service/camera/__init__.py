"""Cameras: where pictures come from, how they are published, calibrated and taken as goals."""
