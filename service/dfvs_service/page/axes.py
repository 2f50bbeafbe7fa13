"""Axes of charts: range, ticks, and position of a value."""

import math
from collections.abc import Sequence
from dataclasses import dataclass

_TICKS = 4
_BELOW_TOLERANCE = 10.0
"""A logarithmic axis goes so many times below the tolerance at most."""
_STEPS = (1.0, 2.0, 5.0)


@dataclass(frozen=True, slots=True)
class Axis:
    """Range from ``low`` to ``high`` with its ticks, lowest first."""

    low: float
    high: float
    ticks: tuple[float, ...]
    is_log: bool = False

    def share(self, value: float) -> float:
        """Place of a value between the lower (0) and the upper end (1)."""
        if not self.is_log:
            return (value - self.low) / (self.high - self.low)
        kept = min(max(value, self.low), self.high)
        return math.log(kept / self.low) / math.log(self.high / self.low)


def linear_axis(low: float, high: float) -> Axis:
    """Axis with even ticks around a range."""
    step = nice_step(max(high - low, 1e-3) / _TICKS)
    first = math.floor(low / step)
    while (first + _TICKS) * step < high:
        step = nice_step(step * 1.2)
        first = math.floor(low / step)
    ticks = tuple((first + number) * step for number in range(_TICKS + 1))
    return Axis(ticks[0], ticks[-1], ticks)


def tolerance_axis(values: Sequence[float], tolerance: float) -> Axis:
    """Logarithmic axis around a tolerance; values far below it lie at the lower end."""
    low = max(min(*values, tolerance / 2), tolerance / _BELOW_TOLERANCE)
    return log_axis(low, max(*values, tolerance * 2))


def log_axis(low: float, high: float) -> Axis:
    """Logarithmic axis around a range of positive values."""
    first, last = math.floor(math.log10(low)), math.ceil(math.log10(high))
    marks = [step * 10.0**power for power in range(first, last + 1) for step in _STEPS]
    low = max(mark for mark in marks if mark <= low * (1 + 1e-9))
    high = min(mark for mark in marks if mark >= high * (1 - 1e-9) and mark > low)
    ticks = tuple(mark for mark in marks if low <= mark <= high)
    if len(ticks) > 2 * _TICKS:
        ticks = tuple(mark for mark in ticks if f"{mark:e}".startswith("1.0"))
    return Axis(low, high, ticks, is_log=True)


def nice_step(value: float) -> float:
    """Smallest of 1, 2, 2.5, 5 and 10 times a power of ten that is no less."""
    power = 10.0 ** math.floor(math.log10(value))
    return next(power * m for m in (1.0, 2.0, 2.5, 5.0, 10.0) if power * m >= value * (1 - 1e-9))
