"""Two-view geometry: relative pose of two frames from their correspondences.

Rotation and direction of the baseline minimise the Sampson error with Tukey's weights; the
rotation by the gyroscopes is one more measurement. The length of the baseline follows from the
relative depth of the scene, and so is in its units.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from dfvs_core.depth.depth_map import DepthMap
from dfvs_core.depth.source import EarlierView
from dfvs_core.geometry.arrays import BoolArray, FloatArray
from dfvs_core.geometry.camera import homogeneous
from dfvs_core.geometry.poses import make_pose, skew, so3_exp, so3_log
from dfvs_core.geometry.robust_weights import NoiseScale, tukey_weights, weighted_median
from dfvs_core.servo.exchange import EarlierMatch
from dfvs_core.servo.points import sample_grid
from dfvs_core.servo.task import ServoTask

_ROTATION_SPREAD_RAD = 0.005
"""Standard deviation of the rotation between two frames by the gyroscopes."""

_INDEPENDENT_SHARE = 0.1
"""Points whose errors are independent, over all points: errors of neighbours are alike."""

_LEAST_SIGNIFICANCE = 3.0
"""Baseline over depth, in standard deviations of the rotation, below which two views tell nothing
of depth: a rotation moves all points alike, as a baseline does."""

_LEAST_PARALLAX = 0.008
"""Baseline over depth below which they tell nothing either."""

_LEAST_VALIDITY = 1e-4
"""Weight of a depth that is a mere guess: it counts where nothing is known."""

_LEAST_POINTS = 40
_ITERATIONS = 8
_CONVERGED_RAD = 1e-5
_DAMPING = 1e-6


@dataclass(frozen=True, slots=True)
class _Rays:
    """Correspondences (N, 2) in normalised coordinates of both views, and their weights (N,)."""

    current: FloatArray
    earlier: FloatArray
    weight: FloatArray


@dataclass(frozen=True, slots=True)
class _Geometry:
    """Rotation (3, 3) and direction of the baseline (3,), earlier from current."""

    R: FloatArray
    direction: FloatArray

    def moved(self, step: FloatArray) -> _Geometry:
        """Geometry after a step (5,) rad: a rotation, and a turn of the direction."""
        direction = self.direction + step[3:] @ self._across()
        return _Geometry(so3_exp(step[:3]) @ self.R, direction / np.linalg.norm(direction))

    def sampson(self, rays: _Rays) -> tuple[FloatArray, FloatArray]:
        """Signed Sampson distance (N,) of each correspondence, normalised units.

        With it its slope (5, N), for a step of ``moved``.
        """
        p, q = homogeneous(rays.current), homogeneous(rays.earlier)
        turned = [skew(self.direction) @ skew(axis) @ self.R for axis in np.eye(3)]
        shifted = [skew(axis) @ self.R for axis in self._across()]
        E = np.stack([skew(self.direction) @ self.R, *turned, *shifted])
        line, back = p @ E.swapaxes(1, 2), q @ E
        product, sides = (q * line).sum(axis=2), np.dstack([line[:, :, :2], back[:, :, :2]])
        length = np.sqrt(np.maximum(0.5 * (sides[0] ** 2).sum(axis=1), 1e-18))
        error: FloatArray = product[0] / length
        longer = 0.5 * (sides[1:] * sides[0]).sum(axis=2) / length
        return error, (product[1:] - error * longer) / length

    def _across(self) -> FloatArray:
        """Two unit vectors (2, 3) at right angles to the direction and to each other."""
        least = np.eye(3)[int(np.argmin(np.abs(self.direction)))]
        u = skew(self.direction) @ least
        u /= np.linalg.norm(u)
        return np.stack([u, skew(self.direction) @ u])


def earlier_view(task: ServoTask, match: EarlierMatch, depth: DepthMap) -> EarlierView | None:
    """Correspondences with an earlier frame, and the motion in between by the images.

    Parameters
    ----------
    task : ServoTask
    match : EarlierMatch
        Its motion is the start; of its translation only the direction counts.
    depth : DepthMap
        Relative depth of the current frame, on the grid (h, w).

    Returns
    -------
    EarlierView or None
        None where the baseline is short against the depth, or against what the rotation may be
        wrong by.
    """
    samples = sample_grid(match.flow, task.config.stride_px)
    partners = samples.pixels + samples.flow
    used = _inside(task, partners) & (samples.confidence > task.config.min_confidence)
    length = float(np.linalg.norm(match.T_earlier_current[:3, 3]))
    if np.count_nonzero(used) < _LEAST_POINTS or length <= 0.0:
        return None
    xy, xy_earlier = task.camera.normalise(samples.pixels), task.camera.normalise(partners)
    rays = _Rays(xy[used], xy_earlier[used], samples.confidence[used])
    noise = NoiseScale(task.config.flow_noise_px / task.camera.fx)
    start = _Geometry(match.T_earlier_current[:3, :3], match.T_earlier_current[:3, 3] / length)
    found, weight, spread_rad = _refined(start, rays, noise)
    known = weight * (depth.validity[used] + _LEAST_VALIDITY)
    inverse_depth = 1.0 / depth.z_m[used].astype(np.float64)
    baseline = _baseline(found, rays, known, inverse_depth)
    parallax = baseline * weighted_median(inverse_depth, weight)
    if parallax < max(_LEAST_PARALLAX, _LEAST_SIGNIFICANCE * spread_rad):
        return None
    T_earlier_current = make_pose(found.R, baseline * found.direction)
    return EarlierView(xy_earlier, samples.confidence, T_earlier_current, spread_rad)


def _inside(task: ServoTask, pixels: FloatArray) -> BoolArray:
    within = (pixels >= 0) & (pixels <= [task.camera.width, task.camera.height])
    return np.asarray(within.all(axis=-1), np.bool_)


def _refined(
    start: _Geometry, rays: _Rays, noise: NoiseScale
) -> tuple[_Geometry, FloatArray, float]:
    """Geometry by Gauss-Newton, weights (N,) of the points, and spread of the rotation, rad."""
    found = start
    prior = np.diag([1.0 / _ROTATION_SPREAD_RAD**2] * 3 + [_DAMPING] * 2)
    for _ in range(_ITERATIONS):
        error, J = found.sampson(rays)
        length = np.abs(error)
        weight = rays.weight * tukey_weights(length, rays.weight, noise)
        sigma = max(weighted_median(length, weight) / 0.6745, noise.least)
        scale = _INDEPENDENT_SHARE / sigma**2
        turned = np.append(so3_log(found.R @ start.R.T), np.zeros(2))
        A = scale * (J * weight) @ J.T + prior
        gradient = scale * J @ (weight * error) + prior @ turned
        step = -np.asarray(np.linalg.solve(A, gradient), np.float64)
        found = found.moved(step)
        if float(np.abs(step).max()) < _CONVERGED_RAD:
            break
    covariance = np.linalg.inv(A)[:3, :3]
    return found, weight, float(np.sqrt(np.linalg.eigvalsh(covariance)[-1]))


def _baseline(
    found: _Geometry, rays: _Rays, weight: FloatArray, inverse_depth: FloatArray
) -> float:
    """Length of the baseline for which the triangulated points have the known inverse depths.

    A point at inverse depth rho on the ray r is seen along ``R r + rho b``, b the baseline.
    """
    turned = homogeneous(rays.current) @ found.R.T
    a = found.direction[:2] - rays.earlier * found.direction[2]
    b = rays.earlier * turned[:, 2:] - turned[:, :2]
    parallax_sq = np.maximum((a * a).sum(axis=1), 1e-12)
    ratio = (a * b).sum(axis=1) / parallax_sq / inverse_depth
    return max(weighted_median(ratio, weight * np.sqrt(parallax_sq) * inverse_depth), 0.0)
