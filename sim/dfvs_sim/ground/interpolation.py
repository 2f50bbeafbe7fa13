"""Positions and attitudes at any time between their samples, and a little beyond."""

import bisect
from collections import deque
from dataclasses import dataclass
from typing import TypeVar


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


S = TypeVar("S", PositionSample, AttitudeSample)


def append(samples: deque[S], sample: S) -> None:
    """Keep samples in order of time: a datagram may overtake another."""
    if not samples or sample.stamp_ns > samples[-1].stamp_ns:
        samples.append(sample)


def position_at(samples: deque[PositionSample], stamp_ns: int) -> tuple[float, float, float]:
    """Position: straight between samples, on with the velocity beyond them."""
    a, b, share = _around(samples, stamp_ns)
    if b is None:
        x, y, z = (p + v * share for p, v in zip(a.position, a.velocity, strict=True))
    else:
        x, y, z = _mix(a.position, b.position, share)
    return x, y, z


def attitude_at(samples: deque[AttitudeSample], stamp_ns: int) -> tuple[float, ...]:
    """Quaternion: mix of neighbours, on with the body rates beyond them; of any length but zero."""
    a, b, share = _around(samples, stamp_ns)
    if b is None:
        return _turned(a.quaternion, a.rates, share)
    dot = sum(x * y for x, y in zip(a.quaternion, b.quaternion, strict=True))
    other = b.quaternion if dot >= 0.0 else tuple(-x for x in b.quaternion)
    return _mix(a.quaternion, other, share)


def _around(samples: deque[S], stamp_ns: int) -> tuple[S, S | None, float]:
    """Samples before and behind a time, and its share of the way; s since the last one beyond."""
    i = bisect.bisect_right(samples, stamp_ns, key=lambda s: s.stamp_ns)
    a = samples[max(0, i - 1)]
    if i >= len(samples):
        return a, None, (stamp_ns - a.stamp_ns) / 1e9
    return a, samples[i], (stamp_ns - a.stamp_ns) / (samples[i].stamp_ns - a.stamp_ns)


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
