"""Calibration of a camera with a board."""
