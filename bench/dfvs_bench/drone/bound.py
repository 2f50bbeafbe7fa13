"""The least time that a straight flight takes under the limits in force."""

import math
from dataclasses import dataclass

import numpy as np

from dfvs_core.errors import ConfigError
from dfvs_core.gate.limits import VelocityLimits
from dfvs_core.geometry.arrays import FloatArray


@dataclass(frozen=True, slots=True)
class TimeBound:
    """Least time of the way and of the turn, s; both happen at once.

    Nothing that answers to the limits arrives and comes to rest sooner: the vehicle is taken to
    follow every setpoint at once, and turning to take nothing from the way.
    """

    way_s: float
    turn_s: float

    @property
    def least_s(self) -> float:
        """Time of the slower of the two."""
        return max(self.way_s, self.turn_s)


def straight_line_bound(
    displacement_m: FloatArray, turn_rad: float, limits: VelocityLimits
) -> TimeBound:
    """Time of a straight way (3,) from rest to rest (m), and of a turn (rad), at the limits."""
    distance_m = float(np.linalg.norm(displacement_m))
    speed_m_s = _speed_along(displacement_m, limits)
    return TimeBound(
        way_s=trapezoid_s(distance_m, speed_m_s, limits.slew_m_s2),
        turn_s=trapezoid_s(abs(turn_rad), limits.yaw_rad_s, limits.yaw_slew_rad_s2),
    )


def trapezoid_s(distance: float, speed: float, slew: float) -> float:
    """Least time from rest to rest over a distance with bounded speed and acceleration.

    The speed's profile is a trapezoid, or a triangle where the distance is too short to come to
    full speed. Units are any, as long as they agree.

    Raises
    ------
    ConfigError
        If the distance is negative, or speed or slew are not positive.
    """
    if distance < 0 or speed <= 0 or slew <= 0:
        raise ConfigError(
            f"no way of {distance:g} at speed {speed:g} and slew {slew:g}",
            "no negative distance, and limits above 0",
        )
    if distance * slew <= speed * speed:
        return 2.0 * math.sqrt(distance / slew)
    return distance / speed + speed / slew


def _speed_along(displacement_m: FloatArray, limits: VelocityLimits) -> float:
    """Largest speed along a direction that neither speed limit forbids."""
    north, east, down = (float(v) for v in displacement_m)
    horizontal_m, length_m = math.hypot(north, east), math.hypot(north, east, down)
    times_s = (horizontal_m / limits.horizontal_m_s, abs(down) / limits.vertical_m_s)
    return length_m / max(times_s) if length_m > 0 else limits.horizontal_m_s
