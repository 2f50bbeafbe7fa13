"""Capture of goals: one image, or a route from a flight by hand."""
