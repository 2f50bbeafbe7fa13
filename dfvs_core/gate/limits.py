"""Velocity limits: direction-preserving saturation and slew.

A setpoint above a limit is scaled as a whole: forward, right, down and yaw rate by one common
factor. So the path of the servo law stays the same and only takes longer. Slew works in the same
way on the change since the last setpoint.
"""

from __future__ import annotations

import math
from dataclasses import dataclass


@dataclass(frozen=True, slots=True)
class BodyVelocity:
    """Velocity in the level body frame (m/s; forward, right, down) and yaw rate (rad/s)."""

    forward_m_s: float = 0.0
    right_m_s: float = 0.0
    down_m_s: float = 0.0
    yaw_rad_s: float = 0.0

    def is_finite(self) -> bool:
        """Whether all four numbers are finite."""
        values = (self.forward_m_s, self.right_m_s, self.down_m_s, self.yaw_rad_s)
        return all(math.isfinite(v) for v in values)

    @property
    def horizontal_m_s(self) -> float:
        """Speed over ground."""
        return math.hypot(self.forward_m_s, self.right_m_s)

    @property
    def speed_m_s(self) -> float:
        """Length of the linear velocity."""
        return math.hypot(self.forward_m_s, self.right_m_s, self.down_m_s)

    def scaled(self, factor: float) -> BodyVelocity:
        """All four components times a factor."""
        return BodyVelocity(
            self.forward_m_s * factor,
            self.right_m_s * factor,
            self.down_m_s * factor,
            self.yaw_rad_s * factor,
        )

    def plus(self, other: BodyVelocity) -> BodyVelocity:
        """Sum of two velocities."""
        return BodyVelocity(
            self.forward_m_s + other.forward_m_s,
            self.right_m_s + other.right_m_s,
            self.down_m_s + other.down_m_s,
            self.yaw_rad_s + other.yaw_rad_s,
        )


ZERO = BodyVelocity()


@dataclass(frozen=True, slots=True)
class VelocityLimits:
    """Largest speeds (m/s, rad/s) and rates of change (m/s², rad/s²) of a setpoint."""

    horizontal_m_s: float = 0.5
    vertical_m_s: float = 0.3
    yaw_rad_s: float = math.radians(20.0)
    slew_m_s2: float = 0.5
    yaw_slew_rad_s2: float = math.radians(60.0)


def _ratio(limit: float, value: float) -> float:
    """Factor that takes ``value`` to its limit, 1 where it is within."""
    return limit / value if value > limit else 1.0


def saturate(
    velocity: BodyVelocity, limits: VelocityLimits, most_m_s: float = math.inf
) -> BodyVelocity:
    """Scale a finite velocity as a whole until every axis is within its limit.

    ``most_m_s`` also bounds the length of the linear velocity, as at reduced speed.
    """
    factor = min(
        _ratio(most_m_s, velocity.speed_m_s),
        _ratio(limits.horizontal_m_s, velocity.horizontal_m_s),
        _ratio(limits.vertical_m_s, abs(velocity.down_m_s)),
        _ratio(limits.yaw_rad_s, abs(velocity.yaw_rad_s)),
    )
    return velocity.scaled(factor)


def slew(
    previous: BodyVelocity, target: BodyVelocity, dt_s: float, limits: VelocityLimits
) -> BodyVelocity:
    """Step from the previous setpoint towards the target, no faster than the slew limits."""
    change = target.plus(previous.scaled(-1.0))
    factor = min(
        _ratio(limits.slew_m_s2 * dt_s, change.speed_m_s),
        _ratio(limits.yaw_slew_rad_s2 * dt_s, abs(change.yaw_rad_s)),
    )
    return target if factor == 1.0 else previous.plus(change.scaled(factor))
