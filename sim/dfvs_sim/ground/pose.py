"""The vehicle's pose at a time of this machine's clock, from its telemetry.

The vehicle stamps with its own clock (``time_boot_ms``); ``ClockMap`` takes it to this machine's.
"""

from __future__ import annotations

import bisect
import math
import threading
import time
from collections import deque
from dataclasses import dataclass

import numpy as np

from dfvs_core.arrays import FloatArray
from dfvs_core.poses import make_pose, rotation_from_euler
from dfvs_sim.ground.clock import ClockMap
from dfvs_sim.ground.link import GroundLink, LinkError, Message

_KEPT = 128
_RATE_HZ = 50.0


@dataclass(frozen=True, slots=True)
class VehiclePose:
    """Pose in the vehicle's local frame (NED).

    ``t_ns`` is monotonic time of this machine. Velocity is in NED too.
    """

    t_ns: int
    position_m: tuple[float, float, float]
    velocity_m_s: tuple[float, float, float]
    roll_rad: float
    pitch_rad: float
    yaw_rad: float

    def T_local_body(self) -> FloatArray:
        """Pose (4, 4) of the body (FRD) in the local frame (NED)."""
        R = rotation_from_euler(self.roll_rad, self.pitch_rad, self.yaw_rad)
        return make_pose(R, np.array(self.position_m))


@dataclass(frozen=True, slots=True)
class _Place:
    stamp_ns: int
    position: tuple[float, float, float]
    velocity: tuple[float, float, float]


@dataclass(frozen=True, slots=True)
class _Turn:
    stamp_ns: int
    quaternion: tuple[float, float, float, float]
    rates: tuple[float, float, float]


class PoseTracker:
    """Follows LOCAL_POSITION_NED and ATTITUDE_QUATERNION and answers for a time.

    Parameters
    ----------
    link : GroundLink
        Shared link; both messages are asked for at 50 Hz by ``start``.
    reach_ns : int
        How far beyond the newest sample a pose may be extrapolated.
    """

    def __init__(self, link: GroundLink, reach_ns: int = 200_000_000) -> None:
        self._link = link
        self._reach_ns = reach_ns
        self._lock = threading.Lock()
        self._clock = ClockMap()
        self._places: deque[_Place] = deque(maxlen=_KEPT)
        self._turns: deque[_Turn] = deque(maxlen=_KEPT)
        self._end = link.subscribe(["LOCAL_POSITION_NED", "ATTITUDE_QUATERNION"], self.take)

    def start(self, timeout_s: float = 10.0) -> None:
        """Ask for the streams and wait for the first pose.

        Raises
        ------
        LinkError
            If the vehicle does not answer or sends no pose.
        """
        self._link.wait_for_vehicle(timeout_s)
        since_ns = time.monotonic_ns()
        for name in ("LOCAL_POSITION_NED", "ATTITUDE_QUATERNION"):
            self._link.request_stream(name, _RATE_HZ)
            if self._link.wait_for(name, timeout_s, since_ns=since_ns) is None:
                raise LinkError(
                    f"the vehicle sends no {name}", "its pose", "is its position estimate valid?"
                )

    def close(self) -> None:
        """Stop following."""
        self._end()

    def take(self, message: Message, arrival_ns: int) -> None:
        """Take one message of the two types."""
        stamp_ns = message.time_boot_ms * 1_000_000
        with self._lock:
            if self._clock.update(stamp_ns, arrival_ns):
                self._places.clear()
                self._turns.clear()
            if message.get_type() == "LOCAL_POSITION_NED":
                position = (message.x, message.y, message.z)
                velocity = (message.vx, message.vy, message.vz)
                _append(self._places, _Place(stamp_ns, position, velocity))
            else:
                q = (message.q1, message.q2, message.q3, message.q4)
                rates = (message.rollspeed, message.pitchspeed, message.yawspeed)
                _append(self._turns, _Turn(stamp_ns, q, rates))

    def newest_ns(self) -> int | None:
        """Local time up to which both position and attitude are known; None before the first."""
        with self._lock:
            if not self._places or not self._turns:
                return None
            stamp = min(self._places[-1].stamp_ns, self._turns[-1].stamp_ns)
            return stamp + self._clock.offset_ns

    def pose_at(self, t_ns: int) -> VehiclePose | None:
        """Pose at a monotonic time: interpolated, or extrapolated a little.

        Returns
        -------
        VehiclePose or None
            None before the first samples, for a time older than what is kept, and where the
            newest sample is older than ``reach_ns``.
        """
        with self._lock:
            if not self._places or not self._turns:
                return None
            stamp = t_ns - self._clock.offset_ns
            oldest = max(self._places[0].stamp_ns, self._turns[0].stamp_ns)
            newest = min(self._places[-1].stamp_ns, self._turns[-1].stamp_ns)
            if stamp < oldest or stamp > newest + self._reach_ns:
                return None
            position, velocity = _place_at(self._places, stamp)
            q = _turn_at(self._turns, stamp)
        return VehiclePose(t_ns, position, velocity, *_euler(q))


def _append(samples: deque[_Place] | deque[_Turn], sample: _Place | _Turn) -> None:
    """Keep samples in order of time: a datagram may overtake another."""
    if not samples or sample.stamp_ns > samples[-1].stamp_ns:
        samples.append(sample)  # type: ignore[arg-type]


def _place_at(samples: deque[_Place], stamp_ns: int) -> tuple[tuple[float, float, float], ...]:
    """Position and velocity: straight between samples, on with the velocity beyond them."""
    i = bisect.bisect_right(samples, stamp_ns, key=lambda s: s.stamp_ns)
    a = samples[max(0, i - 1)]
    if i >= len(samples):
        dt_s = (stamp_ns - a.stamp_ns) / 1e9
        x, y, z = (p + v * dt_s for p, v in zip(a.position, a.velocity, strict=True))
        return (x, y, z), a.velocity
    b = samples[i]
    share = (stamp_ns - a.stamp_ns) / (b.stamp_ns - a.stamp_ns)
    x, y, z = _mix(a.position, b.position, share)
    u, v, w = _mix(a.velocity, b.velocity, share)
    return (x, y, z), (u, v, w)


def _turn_at(samples: deque[_Turn], stamp_ns: int) -> tuple[float, ...]:
    """Quaternion: normalised mix of neighbours, on with the body rates beyond them."""
    i = bisect.bisect_right(samples, stamp_ns, key=lambda s: s.stamp_ns)
    a = samples[max(0, i - 1)]
    if i >= len(samples):
        return _turned(a.quaternion, a.rates, (stamp_ns - a.stamp_ns) / 1e9)
    b = samples[i]
    share = (stamp_ns - a.stamp_ns) / (b.stamp_ns - a.stamp_ns)
    dot = sum(x * y for x, y in zip(a.quaternion, b.quaternion, strict=True))
    other = b.quaternion if dot >= 0.0 else tuple(-x for x in b.quaternion)
    return _mix(a.quaternion, other, share)


def _mix(a: tuple[float, ...], b: tuple[float, ...], share: float) -> tuple[float, ...]:
    return tuple(x + share * (y - x) for x, y in zip(a, b, strict=True))


def _turned(
    q: tuple[float, float, float, float], rates: tuple[float, float, float], dt_s: float
) -> tuple[float, ...]:
    """Quaternion after turning with constant body rates (rad/s) for a short time."""
    w, x, y, z = q
    a, b, c = (0.5 * rate * dt_s for rate in rates)
    return (
        w - x * a - y * b - z * c,
        x + w * a + y * c - z * b,
        y + w * b + z * a - x * c,
        z + w * c + x * b - y * a,
    )


def _euler(q: tuple[float, ...]) -> tuple[float, float, float]:
    """Roll, pitch and yaw (rad) of a quaternion (w, x, y, z) of any length but zero."""
    n = math.sqrt(sum(v * v for v in q))
    w, x, y, z = (v / n for v in q)
    roll = math.atan2(2 * (w * x + y * z), 1 - 2 * (x * x + y * y))
    pitch = math.asin(min(1.0, max(-1.0, 2 * (w * y - z * x))))
    yaw = math.atan2(2 * (w * z + x * y), 1 - 2 * (y * y + z * z))
    return roll, pitch, yaw
