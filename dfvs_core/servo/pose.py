"""Robust goal pose from correspondences with depth.

Gauss-Newton on the reprojection of the current view's points into the goal image, with
Tukey's weights. What a point's depth may be wrong by shifts its reprojection along the epipolar
line alone: there its error counts less, across the line in full. The pose gives the error in
metres and degrees, tells outliers from what merely moves far, and gives the points' depth at
the goal that the mean Jacobian needs.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from dfvs_core.geometry.arrays import FloatArray
from dfvs_core.geometry.camera import homogeneous
from dfvs_core.geometry.interaction import interaction_matrix
from dfvs_core.geometry.poses import invert_pose
from dfvs_core.geometry.robust_weights import NoiseScale, tukey_weights, weighted_median
from dfvs_core.servo.freedom import MotionBasis
from dfvs_core.servo.law import normal_equations
from dfvs_core.servo.points import ServoPoints

_MIN_DEPTH_M = 0.05
_DAMPING = 1e-3
_CONVERGED = 1e-4
"""Step, m or rad, that changes nothing any more."""
_LONGEST_STEP = 0.7
"""Most that one step may change a component by, m or rad."""
_EXPLAINED = 10.0
"""Error, in the correspondences' expected noise, from which on a point does not support a pose."""


@dataclass(frozen=True, slots=True)
class GoalPose:
    """Pose of the goal camera in the current camera, and how well it explains the points.

    Parameters
    ----------
    T_current_goal : (4, 4)
        Within the group of motions of the basis; translation in m (as exact as the depth).
    motion : (d,)
        The same as a motion of the basis, m and rad.
    weight : (N,)
        Prior weight times Tukey's factor.
    z_goal_m : (N,)
        Depth of the points in the goal camera.
    residual : float
        Weighted median length of the reprojection error, normalised units; less what the
        uncertainty of the depth explains.
    inlier_share : float
        Weight kept by Tukey's factors over the prior weight, 0 to 1.
    support : float
        Share of the prior weight that the pose explains to within ten times the correspondences'
        expected noise, 0 to 1; what fits exactly counts in full, what would be behind the goal's
        camera not at all.
    """

    T_current_goal: FloatArray
    motion: FloatArray
    weight: FloatArray
    z_goal_m: FloatArray
    residual: float
    inlier_share: float
    support: float


def estimate_goal_pose(
    points: ServoPoints,
    basis: MotionBasis,
    noise: NoiseScale,
    T_guess: FloatArray | None = None,
    iterations: int = 12,
) -> GoalPose:
    """Pose of the goal from correspondences with depth.

    Parameters
    ----------
    points : ServoPoints
        With at least one positive weight.
    basis : MotionBasis
        Motions to choose from.
    noise : NoiseScale
        Of the correspondences, normalised units (expected about 0.3 px / f).
    T_guess : (4, 4), optional
        Start, for instance the last frame's result; identity by default.
    iterations : int
        At most so many Gauss-Newton steps; most frames need three to five.
    """
    P = homogeneous(points.xy) * points.z_m[:, None]
    T = np.eye(4) if T_guess is None else T_guess
    for _ in range(iterations):
        seen = Reprojection.of(T, P, points, noise.least)
        weight = points.weight * tukey_weights(seen.length, points.weight, noise)
        J = seen.noise.whiten(interaction_matrix(seen.xy, seen.z_m) @ basis.B)
        step = normal_equations(J, seen.error, weight).solve(_DAMPING)
        T = T @ basis.exp(_bounded(step))
        if float(np.abs(step).max()) < _CONVERGED:
            break
    seen = Reprojection.of(T, P, points, noise.least)
    weight = points.weight * tukey_weights(seen.length, points.weight, noise)
    explained = 1.0 - np.minimum(seen.length / (_EXPLAINED * noise.least), 1.0) ** 2
    explained *= seen.z_m > _MIN_DEPTH_M
    prior = max(float(points.weight.sum()), 1e-12)
    return GoalPose(
        T_current_goal=T,
        motion=basis.log(T),
        weight=weight,
        z_goal_m=seen.z_m,
        residual=weighted_median(seen.length, points.weight),
        inlier_share=float(weight.sum()) / prior,
        support=float((points.weight * explained).sum()) / prior,
    )


@dataclass(frozen=True, slots=True)
class Reprojection:
    """Points as a pose has them seen in the goal camera.

    ``xy`` (N, 2) and ``z_m`` (N,) are where and how deep, ``error`` (N, 2) is off the
    correspondence, whitened by ``noise``, and ``length`` (N,) its length.
    """

    xy: FloatArray
    z_m: FloatArray
    noise: _DepthNoise
    error: FloatArray
    length: FloatArray

    @classmethod
    def of(
        cls, T_current_goal: FloatArray, P: FloatArray, points: ServoPoints, s: float
    ) -> Reprojection:
        """Points ``P`` (N, 3) m of the current camera by a pose; ``s`` is the flow's noise."""
        xy, z = _project(T_current_goal, P)
        noise = _DepthNoise.of(T_current_goal, xy, z, points.depth_spread, s)
        error = noise.whiten((xy - points.xy_goal)[:, :, None])[:, :, 0]
        return cls(xy, z, noise, error, np.linalg.norm(error, axis=1))


def _project(T_current_goal: FloatArray, P: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Normalised coordinates (N, 2) and depth (N,) of current points in the goal camera."""
    T = invert_pose(T_current_goal)
    Q = P @ T[:3, :3].T + T[:3, 3]
    z = np.maximum(Q[:, 2], _MIN_DEPTH_M)
    return Q[:, :2] / z[:, None], z


@dataclass(frozen=True, slots=True)
class _DepthNoise:
    """What wrong depths do to the reprojections.

    A point seen at ``xy`` with depth ``z`` in the goal camera moves by ``(t_xy - xy t_z) / z``
    for each unit of relative inverse depth, t being the current camera's place there; times its
    spread that is the noise along its epipolar line, on top of the correspondence's own.

    Parameters
    ----------
    along : (N, 2)
        That shift, normalised units.
    shrinkage : (N, 2)
        What is to be taken off an error, for each unit of its product with ``along``.
    """

    along: FloatArray
    shrinkage: FloatArray

    @classmethod
    def of(
        cls, T_current_goal: FloatArray, xy: FloatArray, z: FloatArray, spread: FloatArray, s: float
    ) -> _DepthNoise:
        """Noise of depths with a relative ``spread`` (N,), besides correspondences with ``s``."""
        t = invert_pose(T_current_goal)[:3, 3]
        along = (t[:2] - xy * t[2]) * (spread / z)[:, None]
        squared = np.maximum((along * along).sum(axis=1), 1e-18)
        shrinkage = along * ((1.0 - s / np.sqrt(s * s + squared)) / squared)[:, None]
        return cls(along, shrinkage)

    def whiten(self, vectors: FloatArray) -> FloatArray:
        """Give vectors (N, 2, d) the same noise in every direction."""
        if not self.along.any():
            return vectors
        product = self.along[:, :1] * vectors[:, 0] + self.along[:, 1:] * vectors[:, 1]
        return vectors - self.shrinkage[:, :, None] * product[:, None, :]


def _bounded(step: FloatArray) -> FloatArray:
    """Keep one Gauss-Newton step inside the range where the linear model holds."""
    longest = float(np.abs(step).max())
    return step if longest <= _LONGEST_STEP else step * (_LONGEST_STEP / longest)
