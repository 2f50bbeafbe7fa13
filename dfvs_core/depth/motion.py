"""Metric depth from the vehicle's own motion: two views, a known baseline, a recursive filter."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from dfvs_core.arrays import FloatArray
from dfvs_core.correspondence import DepthMap
from dfvs_core.depth.source import DepthInputs, DepthState, EarlierView
from dfvs_core.servo.weights import weighted_median

_UNKNOWN_VARIANCE = 1e6


@dataclass(frozen=True, slots=True)
class MotionDepth:
    """Inverse depth of every grid point, triangulated against an earlier frame and filtered.

    The rotation between the frames comes from the vehicle's attitude, the baseline from its
    velocity; what remains of the flow is proportional to inverse depth. Each point keeps an
    estimate with a variance that grows as the camera moves on. Where nothing is known yet, the
    median of what is known stands in, and before that ``prior_m``.

    Parameters
    ----------
    prior_m : float
        Depth before anything was measured, m.
    prior_spread : float
        Relative standard deviation of inverse depth around its median in a scene.
    pixel_noise : float
        Standard deviation of a correspondence, normalised units (about 0.5 px / f).
    baseline_noise : float
        Relative standard deviation of the vehicle's velocity.
    drift_per_m : float
        How much relative standard deviation a grid point gains per metre of camera motion,
        since the grid stays with the image and not with the scene.
    near_m, far_m : float
        Bounds of the depth given out.
    """

    prior_m: float = 3.0
    prior_spread: float = 0.5
    pixel_noise: float = 0.0025
    baseline_noise: float = 0.05
    drift_per_m: float = 1.0
    near_m: float = 0.3
    far_m: float = 30.0

    def estimate(
        self, inputs: DepthInputs, state: DepthState | None
    ) -> tuple[DepthMap, DepthState | None]:
        """Depth on the grid: predict, measure, fuse, fill."""
        state = self._predict(inputs, self._memory(inputs.xy, state))
        if inputs.earlier is not None:
            state = self.observe(inputs.xy, inputs.earlier, state)
        return self._fill(state), state

    def observe(self, xy: FloatArray, earlier: EarlierView, state: DepthState | None) -> DepthState:
        """Measure against an earlier frame, and fuse."""
        return self._fuse(self._memory(xy, state), *self._measure(xy, earlier))

    def _memory(self, xy: FloatArray, state: DepthState | None) -> DepthState:
        shape = xy.shape[:2]
        if state is not None and state.rho.shape == shape:
            return state
        return DepthState(np.full(shape, 1.0 / self.prior_m), np.full(shape, _UNKNOWN_VARIANCE))

    def _predict(self, inputs: DepthInputs, state: DepthState) -> DepthState:
        # Going forward brings the scene nearer; the rest of the motion shifts it over the grid.
        shrink = np.clip(1.0 - state.rho * inputs.motion_m[2], 0.5, 2.0)
        moved_m = float(np.linalg.norm(inputs.motion_m))
        variance = state.variance / shrink**4 + (self.drift_per_m * moved_m * state.rho) ** 2
        return DepthState(state.rho / shrink, np.minimum(variance, _UNKNOWN_VARIANCE))

    def _measure(self, xy: FloatArray, earlier: EarlierView) -> tuple[FloatArray, FloatArray]:
        """Inverse depth (h, w) and its variance from the parallax.

        A point at depth z on the ray r = (x, y, 1) is seen in the earlier frame along
        ``R r + rho t``. Crossing out the unknown length of that vector gives two equations that
        are linear in rho: ``(t_xy - q t_z) rho = q (R r)_z - (R r)_xy``, q the earlier pixel.
        """
        R, t = earlier.T_earlier_current[:3, :3], earlier.T_earlier_current[:3, 3]
        rays = np.concatenate([xy, np.ones((*xy.shape[:2], 1))], axis=2) @ R.T
        q = earlier.xy
        a = t[:2] - q * t[2]
        b = q * rays[..., 2:3] - rays[..., :2]
        parallax_sq = np.maximum((a * a).sum(axis=2), 1e-12)
        rho = (a * b).sum(axis=2) / parallax_sq
        # What does not lie on the epipolar line is an error of the match or a moving thing.
        off_line = np.abs(a[..., 0] * b[..., 1] - a[..., 1] * b[..., 0]) / np.sqrt(parallax_sq)
        variance = (self.pixel_noise**2 + off_line**2) / parallax_sq
        variance += (self.baseline_noise * rho) ** 2
        variance = variance / np.maximum(earlier.confidence, 1e-3) ** 2
        good = np.isfinite(rho) & (rho > 0.0) & (earlier.confidence > 0.2)
        return np.where(good, rho, 0.0), np.where(good, variance, _UNKNOWN_VARIANCE)

    def _fuse(self, state: DepthState, rho: FloatArray, variance: FloatArray) -> DepthState:
        """Kalman update per point; a jump of over three sigmas counts as a new surface."""
        innovation = rho - state.rho
        known = variance < _UNKNOWN_VARIANCE
        jumped = known & (innovation**2 > 9.0 * (state.variance + variance))
        prior = np.where(jumped, state.variance + innovation**2, state.variance)
        gain = np.where(known, prior / (prior + variance), 0.0)
        # Not (1 - gain) * prior: that is 0 where a measurement is far surer than the prior.
        fused = np.where(known, gain * variance, prior)
        return DepthState(state.rho + gain * innovation, fused)

    def _fill(self, state: DepthState) -> DepthMap:
        """Depth map: estimates drawn towards their median as far as they are uncertain."""
        information = 1.0 / state.variance
        known = information > 2.0 / _UNKNOWN_VARIANCE
        median = 1.0 / self.prior_m
        if known.any():
            median = weighted_median(state.rho[known], np.sqrt(information[known]))
        spread_sq = (self.prior_spread * median) ** 2
        trust = spread_sq / (spread_sq + state.variance)
        rho = trust * state.rho + (1.0 - trust) * median
        z = 1.0 / np.clip(rho, 1.0 / self.far_m, 1.0 / self.near_m)
        return DepthMap(z.astype(np.float32), trust.astype(np.float32))
