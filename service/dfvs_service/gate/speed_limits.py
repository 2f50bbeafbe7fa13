"""Check of PX4's speed limits against those of the gate's setpoints.

PX4 cuts a velocity to its own limits, and reports the cut one in POSITION_TARGET_LOCAL_NED. That
differs from every setpoint of the gate, which then takes it for another commander's.
"""

import math
from collections.abc import Mapping

from dfvs_core.gate.limits import VelocityLimits

_SETTINGS = {
    "MPC_XY_VEL_MAX": "horizontal_m_s",
    "MPC_Z_VEL_MAX_UP": "vertical_m_s",
    "MPC_Z_VEL_MAX_DN": "vertical_m_s",
}
"""PX4's parameters in m/s, and the limits of the gate that must not be above them."""

SPEED_LIMITS = tuple(_SETTINGS)
_ROUNDING = 1e-6
"""Relative rounding of a parameter, which PX4 sends as float32."""


def speed_refusals(values: Mapping[str, float | None], limits: VelocityLimits) -> tuple[str, ...]:
    """Refusals of limits that are above PX4's.

    ``values`` are PX4's limits by their names, m/s; None is one that this PX4 does not have.
    ``limits`` are those of the gate's setpoints.
    """
    refusals = []
    for name, attribute in _SETTINGS.items():
        limit, value = getattr(limits, attribute), values.get(name)
        if value is None or limit <= value or math.isclose(limit, value, rel_tol=_ROUNDING):
            continue
        refusals.append(
            f"limits.{attribute} is {limit:g} m/s, above {name} {value:g} m/s: what PX4 would fly "
            "looks like another commander's; lower the setting, or raise the parameter"
        )
    return tuple(refusals)
