"""Perception of one goal: from a camera frame to a velocity and a report."""
