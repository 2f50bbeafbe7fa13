"""Fittings that several room types share."""
