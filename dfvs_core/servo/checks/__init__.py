"""Checks of the motion against the images: numbers, not decisions about the flight."""
