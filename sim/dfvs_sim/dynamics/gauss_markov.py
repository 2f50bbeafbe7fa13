"""Gauss-Markov processes: stationary random signals with a correlation time."""

import math
from collections.abc import Callable

import numpy as np

_BLOCK = 4096

Normal = Callable[[], float]
"""Source of independent standard normal numbers."""


def normal_source(rng: np.random.Generator) -> Normal:
    """Standard normal numbers of ``rng``, drawn in blocks: one call a number costs too much."""
    block: list[float] = []

    def draw() -> float:
        if not block:
            block.extend(rng.standard_normal(_BLOCK).tolist())
        return block.pop()

    return draw


class FirstOrder:
    """Ornstein-Uhlenbeck process; its autocorrelation is exp(-t / time_s)."""

    __slots__ = ("_normal", "_sd", "_time_s", "value")

    def __init__(self, sd: float, time_s: float, normal: Normal) -> None:
        self._sd = sd
        self._time_s = time_s
        self._normal = normal
        self.value = sd * normal()

    def step(self, dt_s: float) -> float:
        """Advance by ``dt_s``, which has to be much shorter than the correlation time."""
        share = dt_s / self._time_s
        self.value += self._sd * math.sqrt(2.0 * share) * self._normal() - self.value * share
        return self.value


class SecondOrder:
    """Critically damped process; its autocorrelation is (1 + t / time_s) exp(-t / time_s)."""

    __slots__ = ("_normal", "_sd", "_time_s", "rate", "value")

    def __init__(self, sd: float, time_s: float, normal: Normal) -> None:
        self._sd = sd
        self._time_s = time_s
        self._normal = normal
        self.value = sd * normal()
        self.rate = sd / time_s * normal()

    def step(self, dt_s: float) -> float:
        """Advance by ``dt_s``, which has to be much shorter than the correlation time."""
        share = dt_s / self._time_s
        kick = 2.0 * self._sd / self._time_s * math.sqrt(share) * self._normal()
        self.rate += kick - share * (2.0 * self.rate + self.value / self._time_s)
        self.value += self.rate * dt_s
        return self.value
