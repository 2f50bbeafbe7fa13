"""Rest of a hovering vehicle, as a statistic of its estimated velocity.

The estimate of a still vehicle is not zero: it errs by 0.01 to 0.3 m/s, for seconds on end. Rest
is a mean over a window that is small, or small against its standard error.
"""

from __future__ import annotations

import math
from collections import deque
from dataclasses import dataclass

import numpy as np

from dfvs_core.geometry.arrays import FloatArray

_BATCHES = 4
"""Parts of a window whose means give the standard error: neighbouring samples err alike."""


@dataclass(frozen=True, slots=True)
class RestLimits:
    """What counts as rest.

    Parameters
    ----------
    window_s : float
        Over which velocity and height are averaged.
    speed_m_s : float
        Mean velocity that is rest in any case.
    standard_errors : float
        Mean velocity that is rest as well, in standard errors of itself.
    height_m : float
        Distance to the wanted height.
    slow_m_s : float
        Mean velocity that an estimate with satellites alone shows of a hovering vehicle.
    """

    window_s: float = 2.0
    speed_m_s: float = 0.05
    standard_errors: float = 2.0
    height_m: float = 0.25
    slow_m_s: float = 0.6


class RestDetector:
    """Takes estimated velocities and says whether they are those of a vehicle at rest.

    Parameters
    ----------
    down_m : float or None
        Wanted height as local z; None takes any.
    limits : RestLimits
    """

    def __init__(self, down_m: float | None = None, limits: RestLimits | None = None) -> None:
        self._down_m = down_m
        self.limits = limits or RestLimits()
        self._samples: deque[tuple[float, ...]] = deque()
        self._has_window = False

    def add(self, t_s: float, velocity_m_s: tuple[float, float, float], down_m: float) -> None:
        """Take one estimate: monotonic time, velocity and local z (NED)."""
        self._samples.append((t_s, *velocity_m_s, down_m))
        while t_s - self._samples[0][0] >= self.limits.window_s:
            self._samples.popleft()
            self._has_window = len(self._samples) >= 2 * _BATCHES

    @property
    def speed_m_s(self) -> float:
        """Length of the mean velocity over the window; infinite before there is one."""
        if not self._has_window:
            return math.inf
        return float(np.linalg.norm(self._window()[:, 1:4].mean(axis=0)))

    @property
    def is_at_rest(self) -> bool:
        """Whether the vehicle hovers at its height."""
        return self._is_below(max(self.limits.speed_m_s, self._tolerance_m_s()))

    @property
    def is_slow(self) -> bool:
        """Whether its estimate shows no more motion than a poor one does of a hovering vehicle."""
        return self._is_below(self.limits.slow_m_s)

    def _window(self) -> FloatArray:
        return np.array(self._samples)

    def _tolerance_m_s(self) -> float:
        """Mean velocity that chance alone explains."""
        if not self._has_window:
            return 0.0
        batches = np.array_split(self._window()[:, 1:4], _BATCHES)
        means = np.array([batch.mean(axis=0) for batch in batches])
        error = np.linalg.norm(means.std(axis=0, ddof=1)) / math.sqrt(_BATCHES)
        return self.limits.standard_errors * float(error)

    def _is_below(self, speed_m_s: float) -> bool:
        if self.speed_m_s >= speed_m_s:
            return False
        if self._down_m is None:
            return True
        return abs(float(self._window()[:, 4].mean()) - self._down_m) < self.limits.height_m
