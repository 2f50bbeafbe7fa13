"""SET_POSITION_TARGET_LOCAL_NED: what PX4 takes from it, and for how long it counts."""

import math
from dataclasses import dataclass
from typing import Any

from dfvs_sim.dynamics.control import NAN_VECTOR, Demand
from dfvs_sim.dynamics.rigid_body import Vector

LOCAL_NED, BODY_NED = 1, 8
"""The only coordinate frames that are accepted."""

_X, _Y, _Z = 1, 2, 4
_VELOCITY, _ACCELERATION = 8 | 16 | 32, 64 | 128 | 256
_YAW, _YAW_RATE = 1024, 2048


@dataclass(frozen=True, slots=True)
class Setpoint:
    """The message's fields: coordinate frame, type mask and values as they came."""

    frame: int
    mask: int
    position: Vector
    velocity: Vector
    acceleration: Vector
    yaw_rad: float
    yaw_rate_rad_s: float

    def as_json(self) -> dict[str, Any]:
        """Fields for the vehicle's record; NaN and infinity as text, since JSON has none."""
        return {
            "frame": self.frame,
            "mask": self.mask,
            "position": [_plain(v) for v in self.position],
            "velocity": [_plain(v) for v in self.velocity],
            "acceleration": [_plain(v) for v in self.acceleration],
            "yaw_rad": _plain(self.yaw_rad),
            "yaw_rate_rad_s": _plain(self.yaw_rate_rad_s),
        }


def demand_from_setpoint(setpoint: Setpoint, yaw_rad: float) -> Demand | None:
    """Demand in NED, or None where no axis is valid: such a message is no sign of life.

    A vector in the body frame is turned by the vehicle's yaw alone, now, on arrival. If one of
    vx, vy, vz is ignored the whole velocity is. Positions in the body frame are not taken.
    """
    mask = setpoint.mask
    position, velocity, acceleration = NAN_VECTOR, NAN_VECTOR, NAN_VECTOR
    if setpoint.frame == LOCAL_NED:
        x, y, z = setpoint.position
        position = (_unless(mask & _X, x), _unless(mask & _Y, y), _unless(mask & _Z, z))
    if not mask & _VELOCITY:
        velocity = _in_ned(setpoint, setpoint.velocity, yaw_rad)
    if not mask & _ACCELERATION:
        acceleration = _in_ned(setpoint, setpoint.acceleration, yaw_rad)
    if not any(math.isfinite(v) for v in (*position, *velocity, *acceleration)):
        return None
    yaw = _unless(mask & _YAW, setpoint.yaw_rad)
    if setpoint.frame == BODY_NED:
        yaw += yaw_rad
    return Demand(
        position, velocity, acceleration, yaw, _unless(mask & _YAW_RATE, setpoint.yaw_rate_rad_s)
    )


def is_flyable(demand: Demand) -> bool:
    """Whether every axis is given by position, velocity or acceleration, all of them finite.

    Anything else makes PX4 stop and wait.
    """
    return all(
        any(math.isfinite(v[axis]) for v in (demand.position, demand.velocity, demand.acceleration))
        for axis in range(3)
    )


def _plain(value: float) -> float | str:
    return value if math.isfinite(value) else str(value)


def _unless(ignored: int, value: float) -> float:
    return math.nan if ignored or not math.isfinite(value) else value


def _in_ned(setpoint: Setpoint, vector: Vector, yaw_rad: float) -> Vector:
    x, y, z = (v if math.isfinite(v) else math.nan for v in vector)
    if setpoint.frame == LOCAL_NED:
        return x, y, z
    c, s = math.cos(yaw_rad), math.sin(yaw_rad)
    return c * x - s * y, s * x + c * y, z
