"""True position and velocity from HIL_STATE_QUATERNION, without the steps of its resolution.

The message has latitude and longitude in 1e-7 degree (11 mm to the north), the altitude in mm and
the velocity in cm/s, all cut off towards zero: numbers tell intervals. The velocity is predicted by
the tilt of a multirotor, its drag and a slow disturbance (wind), and kept within its interval. The
position integrates it and is led back smoothly into the interval of the newest sample.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

from dfvs_sim.dynamics.rigid_body import DRAG_1_S, GRAVITY_M_S2, Vector
from dfvs_sim.geodesy import metres_per_degree
from dfvs_sim.ground.link import Message

_CM = 0.01
_RECOVERY_S, _VELOCITY_RECOVERY_S = 0.1, 0.3
"""Time constants with which a position outside its interval corrects position and velocity."""
_SETTLING_S = 1.0
"""Time constant with which a velocity that nothing predicts goes to its interval's middle."""
_ADAPTATION_1_S = 3.0
"""Acceleration that the disturbance learns from a velocity outside its interval, per m/s."""
_DISTURBANCE_S = 60.0
"""Time constant with which the disturbance is forgotten."""
_LEAST_UP = 0.5
"""Cosine of the tilt from which on it predicts nothing."""
_GAP_S = 0.5
"""Time without samples after which the filter starts anew."""


@dataclass(frozen=True, slots=True)
class LocalOrigin:
    """Place of the local frame's origin on the earth, in the units of GPS_GLOBAL_ORIGIN."""

    latitude_e7: int
    longitude_e7: int
    altitude_mm: int

    def north_east_down(self, message: Message) -> Vector:
        """Middle of what HIL_STATE_QUATERNION tells of the position, m."""
        altitude_m = self.altitude_mm / 1000.0
        north, east = metres_per_degree(self.latitude_e7 * 1e-7, altitude_m)
        return (
            (_middle(message.lat) - self.latitude_e7) * 1e-7 * north,
            (_middle(message.lon) - self.longitude_e7) * 1e-7 * east,
            altitude_m - _middle(message.alt) / 1000.0,
        )

    def resolution_m(self) -> Vector:
        """Width of the position's interval on each axis."""
        north, east = metres_per_degree(self.latitude_e7 * 1e-7, self.altitude_mm / 1000.0)
        return 1e-7 * north, 1e-7 * east, 1e-3

    @classmethod
    def placing(cls, message: Message, local_m: Vector) -> LocalOrigin:
        """Origin by which the vehicle of HIL_STATE_QUATERNION is at a local position (NED, m)."""
        north, east = metres_per_degree(message.lat * 1e-7, message.alt / 1000.0)
        return cls(
            round(message.lat - local_m[0] / (1e-7 * north)),
            round(message.lon - local_m[1] / (1e-7 * east)),
            round(message.alt + local_m[2] * 1000.0),
        )


class TruthFilter:
    """Follows the samples of one vehicle."""

    def __init__(self, origin: LocalOrigin) -> None:
        self._origin = origin
        self._axes = [_Axis(width) for width in origin.resolution_m()]
        self._stamp_ns: int | None = None

    def update(self, stamp_ns: int, message: Message) -> tuple[Vector, Vector]:
        """Position (m) and velocity (m/s) in the local frame (NED) at the message's time."""
        dt_s = math.inf if self._stamp_ns is None else (stamp_ns - self._stamp_ns) / 1e9
        self._stamp_ns = stamp_ns
        middle = self._origin.north_east_down(message)
        speeds = (message.vx, message.vy, message.vz)
        tilt = (*_tilt_acceleration(message.attitude_quaternion), None)
        for axis, *sample in zip(self._axes, middle, speeds, tilt, strict=True):
            if 0.0 < dt_s <= _GAP_S:
                axis.advance(dt_s, *sample)
            else:
                axis.reset(*sample[:2])
        north, east, down = self._axes
        return (
            (north.position_m, east.position_m, down.position_m),
            (north.velocity_m_s, east.velocity_m_s, down.velocity_m_s),
        )


class _Axis:
    """Position and velocity of one axis, and the acceleration that tilt and drag do not explain."""

    def __init__(self, width_m: float) -> None:
        self._half_m = 0.5 * width_m
        self.position_m = self.velocity_m_s = self._disturbance_m_s2 = 0.0

    def reset(self, middle_m: float, reported_cm_s: int) -> None:
        """Start from one sample."""
        self.position_m, self.velocity_m_s = middle_m, _CM * _middle(reported_cm_s)
        self._disturbance_m_s2 = 0.0

    def advance(
        self, dt_s: float, middle_m: float, reported_cm_s: int, tilt_m_s2: float | None
    ) -> None:
        """Go on by ``dt_s`` to a sample."""
        middle, half = _CM * _middle(reported_cm_s), _CM * (0.5 if reported_cm_s else 1.0)
        before = self.velocity_m_s
        if tilt_m_s2 is None:
            predicted = before + (middle - before) * dt_s / _SETTLING_S
        else:
            predicted = before + (tilt_m_s2 + self._disturbance_m_s2 - DRAG_1_S * before) * dt_s
        velocity = min(middle + half, max(middle - half, predicted))
        self._disturbance_m_s2 += _ADAPTATION_1_S * (velocity - predicted)
        self._disturbance_m_s2 -= self._disturbance_m_s2 * dt_s / _DISTURBANCE_S
        self.position_m += 0.5 * (before + velocity) * dt_s
        error = middle_m - self.position_m
        outside = math.copysign(max(0.0, abs(error) - self._half_m), error)
        self.position_m += outside * min(1.0, dt_s / _RECOVERY_S)
        self.velocity_m_s = velocity + outside * dt_s / _VELOCITY_RECOVERY_S**2


def _tilt_acceleration(quaternion: Sequence[float]) -> tuple[float, float]:
    """Acceleration to the north and east (m/s²) of a hovering multirotor of this attitude."""
    w, x, y, z = quaternion
    up = 1.0 - 2.0 * (x * x + y * y)
    if up < _LEAST_UP:
        return 0.0, 0.0
    return -GRAVITY_M_S2 * 2.0 * (x * z + w * y) / up, -GRAVITY_M_S2 * 2.0 * (y * z - w * x) / up


def _middle(reported: int) -> float:
    """Middle of the interval that is cut off to this number."""
    if reported == 0:
        return 0.0
    return reported + math.copysign(0.5, reported)
