"""Velocity profiles with limited acceleration and jerk, for the modes that fly by themselves."""

import math


class SmoothAxis:
    """Position, velocity and acceleration of one axis on its way to a velocity."""

    __slots__ = ("acceleration", "position", "velocity")

    def __init__(self, position: float = 0.0, velocity: float = 0.0) -> None:
        self.position = position
        self.velocity = velocity
        self.acceleration = 0.0

    def approach(self, dt_s: float, velocity: float, acceleration: float, jerk: float) -> None:
        """Advance by dt_s towards ``velocity`` within the limits on acceleration and jerk."""
        missing = velocity - self.velocity
        fastest = math.sqrt(2.0 * jerk * abs(missing))
        wanted = math.copysign(min(acceleration, fastest), missing)
        change = jerk * dt_s
        self.acceleration += min(change, max(-change, wanted - self.acceleration))
        if abs(missing) <= 2.0 * jerk * dt_s * dt_s:
            self.velocity, self.acceleration = velocity, 0.0
        self.velocity += self.acceleration * dt_s
        self.position += self.velocity * dt_s


def speed_to_stop_in(distance: float, acceleration: float, jerk: float) -> float:
    """Highest speed from which the profile stops within the distance (PX4's formula)."""
    b = 4.0 * acceleration * acceleration / jerk
    return 0.5 * (-b + math.sqrt(b * b + 8.0 * acceleration * max(0.0, distance)))
