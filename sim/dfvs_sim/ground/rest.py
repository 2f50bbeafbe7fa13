"""Rest of a hovering vehicle, as a statistic of its estimated velocity.

The estimate of a still vehicle is not zero: it errs by 0.01 to 0.3 m/s, for seconds on end. Rest
is a mean over a window that is small, or small against its standard error.
"""

import math
from collections import deque

import numpy as np

from dfvs_core.geometry.arrays import FloatArray

WINDOW_S = 2.0
"""Span over which velocity and height are averaged."""
_REST_M_S, _REST_STANDARD_ERRORS = 0.05, 2.0
"""Mean velocity that is rest: in any case, or in standard errors of itself."""
_SLOW_M_S = 0.6
"""Mean velocity that an estimate with satellites alone shows of a hovering vehicle."""
_HEIGHT_M = 0.25
"""Distance to the wanted height."""
_BATCHES = 4
"""Parts of a window whose means give the standard error: neighbouring samples err alike."""


class RestDetector:
    """Takes estimated velocities and says whether they are those of a vehicle at rest.

    It rests at a local z of ``down_m``, or anywhere.
    """

    def __init__(self, down_m: float | None = None) -> None:
        self._down_m = down_m
        self._samples: deque[tuple[float, ...]] = deque()
        self._has_window = False

    def add(self, t_s: float, velocity_m_s: tuple[float, float, float], down_m: float) -> None:
        """Take one estimate: monotonic time, velocity and local z (NED)."""
        self._samples.append((t_s, *velocity_m_s, down_m))
        while t_s - self._samples[0][0] >= WINDOW_S:
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
        is_still = self.speed_m_s < max(_REST_M_S, self._tolerance_m_s())
        return is_still and self.is_at_height

    @property
    def is_slow(self) -> bool:
        """Whether its estimate shows no more motion than a poor one does of a hovering vehicle."""
        return self.speed_m_s < _SLOW_M_S

    @property
    def height_error_m(self) -> float:
        """Mean height over the window above the wanted one; 0 where there is none of the two."""
        if self._down_m is None or not self._has_window:
            return 0.0
        return self._down_m - float(self._window()[:, 4].mean())

    @property
    def is_at_height(self) -> bool:
        """Whether the vehicle is at the wanted height."""
        return abs(self.height_error_m) < _HEIGHT_M

    def _window(self) -> FloatArray:
        return np.array(self._samples)

    def _tolerance_m_s(self) -> float:
        """Mean velocity that chance alone explains."""
        if not self._has_window:
            return 0.0
        batches = np.array_split(self._window()[:, 1:4], _BATCHES)
        means = np.array([batch.mean(axis=0) for batch in batches])
        error = np.linalg.norm(means.std(axis=0, ddof=1)) / math.sqrt(_BATCHES)
        return _REST_STANDARD_ERRORS * float(error)
