"""Limits and depth network of the settings that a service flies by."""

import math
from collections.abc import Mapping
from typing import Any

from dfvs_core.gate.limits import VelocityLimits
from dfvs_core.servo.config import BY_NETWORK


def depth_network(settings: Mapping[str, Any]) -> str | None:
    """Bundle of the depth network that perception needs with these settings, if any."""
    return settings["depth"]["model"] if settings["servo"]["depth"] in BY_NETWORK else None


def velocity_limits(settings: Mapping[str, Any]) -> VelocityLimits:
    """Limits with these settings: the lower of the servo law's and the gate's.

    The reduced speed of the first moments (``gate.reduced_speed_m_s``) is not among them.
    """
    servo, gate = settings["servo"], settings["limits"]
    return VelocityLimits(
        horizontal_m_s=min(servo["max_horizontal_m_s"], gate["horizontal_m_s"]),
        vertical_m_s=min(servo["max_vertical_m_s"], gate["vertical_m_s"]),
        yaw_rad_s=math.radians(min(servo["max_turn_deg_s"], gate["yaw_deg_s"])),
        slew_m_s2=gate["slew_m_s2"],
        yaw_slew_rad_s2=math.radians(gate["yaw_slew_deg_s2"]),
    )
