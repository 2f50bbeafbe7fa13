"""Depth from motion: the relative structure of the goal view, from two-view triangulation.

The scene is static, and so is its depth in the goal view. One inverse depth is kept for every cell
of the goal image, and measurements of the whole flight add up without drift. The unit is arbitrary;
its length in metres is not known here.
"""

from dataclasses import dataclass

import numpy as np

from dfvs_core.depth.depth_map import DepthMap
from dfvs_core.depth.source import UNKNOWN_VARIANCE, DepthState, EarlierView, GoalLink
from dfvs_core.geometry.arrays import FloatArray
from dfvs_core.geometry.camera import homogeneous
from dfvs_core.geometry.poses import invert_pose
from dfvs_core.geometry.robust_weights import weighted_median

_PRIOR_SPREAD = 0.5
"""Relative standard deviation of inverse depth around its median in a scene."""
_NEAR, _FAR = 0.1, 10.0
"""Bounds of the depth given out, in parts of the prior."""
_NEAREST = 0.02
"""Depth in units below which a point is taken for one at that depth."""


@dataclass(frozen=True, slots=True)
class MotionDepth:
    """Inverse depth of every cell of the goal view, triangulated in pairs of frames and filtered.

    Where nothing is known yet the median of what is known stands in, and before that ``prior``.

    Parameters
    ----------
    prior : float
        Depth before anything was measured, in units.
    pixel_noise : float
        Standard deviation of a correspondence, normalised units (about 0.5 px / f).
    least_spread : float
        Relative standard deviation of inverse depth that no number of measurements undercuts.
    """

    prior: float = 3.0
    pixel_noise: float = 0.0025
    least_spread: float = 0.02

    def estimate(
        self, shape: tuple[int, ...], link: GoalLink | None, state: DepthState | None
    ) -> DepthMap:
        """Depth on the current grid of ``shape`` (h, w), filled where the goal view is not seen."""
        return self._fill(*self._in_current_view(shape, link, state))

    def observe(
        self, xy: FloatArray, earlier: EarlierView, link: GoalLink, state: DepthState | None
    ) -> DepthState:
        """Measure the current grid ``xy`` (h, w, 2) against an earlier frame, and fuse."""
        state = self._memory(link, state)
        rho, variance = self._measure(xy, earlier)
        cells, means, variances = _in_goal_view(xy, (rho, variance), link)
        return self._fuse(state, cells, means, variances)

    def adopt(self, xy: FloatArray, depth: DepthMap, link: GoalLink) -> DepthState:
        """Memory of a goal whose view is new, from the depth of the current grid."""
        trust = np.clip(depth.validity.astype(np.float64), 1e-3, 1.0 - 1e-3)
        rho = 1.0 / depth.z_m.astype(np.float64)
        variance = (_PRIOR_SPREAD * rho) ** 2 * (1.0 - trust) / trust
        variance = np.where(depth.measured, variance, UNKNOWN_VARIANCE)
        cells, means, variances = _in_goal_view(xy, (rho, variance), link)
        return self._fuse(self._memory(link, None), cells, means, variances)

    def _memory(self, link: GoalLink, state: DepthState | None) -> DepthState:
        shape = link.grid_shape
        if state is not None and state.rho.shape == shape:
            return state
        return DepthState(np.full(shape, 1.0 / self.prior), np.full(shape, UNKNOWN_VARIANCE))

    def _in_current_view(
        self, shape: tuple[int, ...], link: GoalLink | None, state: DepthState | None
    ) -> tuple[FloatArray, FloatArray]:
        """Inverse depth (h, w) of the current grid and its variance."""
        if link is None or state is None:
            return np.full(shape, 1.0 / self.prior), np.full(shape, UNKNOWN_VARIANCE)
        seen = link.cell >= 0
        cell = np.where(seen, link.cell, 0)
        rho_goal, variance_goal = state.rho.ravel()[cell], state.variance.ravel()[cell]
        T = link.T_current_goal
        z = (homogeneous(link.xy_goal) / rho_goal[..., None]) @ T[2, :3] + T[2, 3]
        rho = 1.0 / np.maximum(z, _NEAREST)
        variance = variance_goal * (rho / rho_goal) ** 4
        unknown = ~seen | (variance_goal >= 0.5 * UNKNOWN_VARIANCE)
        return rho, np.where(unknown, UNKNOWN_VARIANCE, variance)

    def _measure(self, xy: FloatArray, earlier: EarlierView) -> tuple[FloatArray, FloatArray]:
        """Inverse depth (h, w) and its variance from the parallax.

        A point at depth z on the ray r = (x, y, 1) is seen in the earlier frame along
        ``R r + rho t``. Crossing out the unknown length of that vector gives two equations that
        are linear in rho: ``(t_xy - q t_z) rho = q (R r)_z - (R r)_xy``, q the earlier pixel.
        """
        R, t = earlier.T_earlier_current[:3, :3], earlier.T_earlier_current[:3, 3]
        rays = homogeneous(xy) @ R.T
        q = earlier.xy
        a = t[:2] - q * t[2]
        b = q * rays[..., 2:3] - rays[..., :2]
        parallax_sq = np.maximum((a * a).sum(axis=2), 1e-12)
        rho = (a * b).sum(axis=2) / parallax_sq
        # What does not lie on the epipolar line is an error of the match or a moving thing.
        off_line = np.abs(a[..., 0] * b[..., 1] - a[..., 1] * b[..., 0]) / np.sqrt(parallax_sq)
        noise_sq = self.pixel_noise**2 + earlier.rotation_spread_rad**2
        variance = (noise_sq + off_line**2) / parallax_sq
        variance = variance / np.maximum(earlier.confidence, 1e-3) ** 2
        good = np.isfinite(rho) & (rho > 0.0) & (earlier.confidence > 0.2)
        return np.where(good, rho, 0.0), np.where(good, variance, UNKNOWN_VARIANCE)

    def _fuse(
        self, state: DepthState, cells: FloatArray, rho: FloatArray, variance: FloatArray
    ) -> DepthState:
        """Kalman update of some cells; a jump of over three sigmas counts as a new surface."""
        means, variances = state.rho.ravel().copy(), state.variance.ravel().copy()
        innovation = rho - means[cells]
        prior = variances[cells]
        jumped = innovation**2 > 9.0 * (prior + variance)
        prior = np.where(jumped, prior + innovation**2, prior)
        gain = prior / (prior + variance)
        means[cells] += gain * innovation
        # Not (1 - gain) * prior: that is 0 where a measurement is far surer than the prior.
        least = (self.least_spread * means[cells]) ** 2
        variances[cells] = np.maximum(gain * variance, least)
        shape = state.rho.shape
        return DepthState(means.reshape(shape), variances.reshape(shape))

    def _fill(self, rho: FloatArray, variance: FloatArray) -> DepthMap:
        """Depth map: estimates drawn towards their median as far as they are uncertain."""
        information = 1.0 / variance
        known = information > 2.0 / UNKNOWN_VARIANCE
        median = 1.0 / self.prior
        if known.any():
            median = weighted_median(rho[known], np.sqrt(information[known]))
        spread_sq = (_PRIOR_SPREAD * median) ** 2
        trust = spread_sq / (spread_sq + variance)
        filled = trust * rho + (1.0 - trust) * median
        bounded = np.clip(filled, 1.0 / (_FAR * self.prior), 1.0 / (_NEAR * self.prior))
        validity = trust * np.minimum(filled / bounded, bounded / filled)
        return DepthMap((1.0 / bounded).astype(np.float32), validity.astype(np.float32))


def _in_goal_view(
    xy: FloatArray, measured: tuple[FloatArray, FloatArray], link: GoalLink
) -> tuple[FloatArray, FloatArray, FloatArray]:
    """Measurements (h, w) of the current grid as cells (n,) of the goal view: rho and variance.

    Of several points in a cell the surest counts.
    """
    rho, variance = measured
    good = (link.cell >= 0) & (variance < 0.5 * UNKNOWN_VARIANCE) & (rho > 0.0)
    T = invert_pose(link.T_current_goal)
    z = (homogeneous(xy[good]) / rho[good][:, None]) @ T[2, :3] + T[2, 3]
    ahead = z > _NEAREST
    rho_goal = 1.0 / z[ahead]
    variance_goal = variance[good][ahead] * (rho_goal / rho[good][ahead]) ** 4
    cells = link.cell[good][ahead]
    confident_last = np.argsort(-variance_goal, kind="stable")
    best = np.full(link.grid_shape[0] * link.grid_shape[1], -1)
    best[cells[confident_last]] = confident_last
    chosen = best[best >= 0]
    return cells[chosen], rho_goal[chosen], variance_goal[chosen]
