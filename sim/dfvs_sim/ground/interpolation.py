"""Positions and attitudes at any time between their samples, and a little beyond."""

from __future__ import annotations

import bisect
import math
from collections import deque
from dataclasses import dataclass


@dataclass(frozen=True, slots=True)
class PositionSample:
    """Position (m) and velocity (m/s) in NED at a vehicle time."""

    stamp_ns: int
    position: tuple[float, float, float]
    velocity: tuple[float, float, float]


@dataclass(frozen=True, slots=True)
class AttitudeSample:
    """Quaternion (w, x, y, z) and body rates (rad/s) at a vehicle time."""

    stamp_ns: int
    quaternion: tuple[float, float, float, float]
    rates: tuple[float, float, float]


def append(
    samples: deque[PositionSample] | deque[AttitudeSample], sample: PositionSample | AttitudeSample
) -> None:
    """Keep samples in order of time: a datagram may overtake another."""
    if not samples or sample.stamp_ns > samples[-1].stamp_ns:
        samples.append(sample)  # type: ignore[arg-type]


def position_at(
    samples: deque[PositionSample], stamp_ns: int
) -> tuple[tuple[float, float, float], ...]:
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


def attitude_at(samples: deque[AttitudeSample], stamp_ns: int) -> tuple[float, ...]:
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


def euler(q: tuple[float, ...]) -> tuple[float, float, float]:
    """Roll, pitch and yaw (rad) of a quaternion (w, x, y, z) of any length but zero."""
    n = math.sqrt(sum(v * v for v in q))
    w, x, y, z = (v / n for v in q)
    roll = math.atan2(2 * (w * x + y * z), 1 - 2 * (x * x + y * y))
    pitch = math.asin(min(1.0, max(-1.0, 2 * (w * y - z * x))))
    yaw = math.atan2(2 * (w * z + x * y), 1 - 2 * (y * y + z * z))
    return roll, pitch, yaw
