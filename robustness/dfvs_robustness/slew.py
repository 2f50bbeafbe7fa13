"""Slew rule of invariant I1: how long a change between two setpoints must take."""

from dfvs_core.gate.limits import BodyVelocity, VelocityLimits


def least_time_s(before: BodyVelocity, after: BodyVelocity, limits: VelocityLimits) -> float:
    """Shortest time from one setpoint to another by the slew limits, s; braking to zero aside."""
    change = after.plus(before.scaled(-1.0))
    return max(change.speed_m_s / limits.slew_m_s2, abs(change.yaw_rad_s) / limits.yaw_slew_rad_s2)
