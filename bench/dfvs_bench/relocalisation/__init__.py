"""Relocalisation of wide-baseline pairs, and tracking on the last part of the way to a goal."""
