"""Reset of the estimated heading in flight, as PX4 makes it above disturbances near the ground."""

import math

import numpy as np

from dfvs_sim.dynamics.estimate_errors import EstimateErrors

_HEIGHT_M = 1.5
"""Estimated height above the ground at which PX4 takes the heading of its magnetometer."""


class HeadingReset:
    """Error of the heading up to its reset, which comes once, or never where its change is 0.

    The change is drawn from the generator's seed; its own sequence is left as it is.
    """

    def __init__(self, errors: EstimateErrors, rng: np.random.Generator) -> None:
        mean_deg, sd_deg = errors.heading_reset_mean_deg, errors.heading_reset_deg
        self._is_pending = mean_deg != 0.0 or sd_deg != 0.0
        (source,) = rng.spawn(1)
        change_deg = mean_deg + sd_deg * float(source.standard_normal())
        self.error_rad = -math.radians(change_deg) if self._is_pending else 0.0
        """Error of the heading that the reset takes away, rad; 0 after it."""
        self._ground_down_m: float | None = None

    def update(self, down_m: float, *, on_ground: bool) -> float | None:
        """Change of the heading (rad) if it is reset at this estimated down coordinate, or None."""
        if on_ground:
            self._ground_down_m = down_m
        if not self._is_pending or self._ground_down_m is None:
            return None
        if self._ground_down_m - down_m <= _HEIGHT_M:
            return None
        self._is_pending = False
        change, self.error_rad = -self.error_rad, 0.0
        return change
