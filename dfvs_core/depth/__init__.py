"""Depth sources of the current view."""
