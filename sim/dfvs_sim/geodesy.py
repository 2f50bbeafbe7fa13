"""Lengths of small steps on the WGS84 ellipsoid."""

import math

_EQUATOR_RADIUS_M = 6378137.0
_ECCENTRICITY_SQUARED = 6.69437999014e-3


def metres_per_degree(latitude_deg: float, altitude_m: float) -> tuple[float, float]:
    """Length of one degree of latitude and of longitude, in m, at a place."""
    latitude = math.radians(latitude_deg)
    flattening = 1.0 - _ECCENTRICITY_SQUARED * math.sin(latitude) ** 2
    across = _EQUATOR_RADIUS_M / math.sqrt(flattening)
    along = across * (1.0 - _ECCENTRICITY_SQUARED) / flattening
    east = (across + altitude_m) * math.cos(latitude)
    return math.radians(along + altitude_m), math.radians(east)
