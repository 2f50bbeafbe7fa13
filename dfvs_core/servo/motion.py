"""Camera motion to the goal by the configured servo law."""

from collections.abc import Iterator

import numpy as np

from dfvs_core.geometry.arrays import FloatArray
from dfvs_core.geometry.robust_weights import NoiseScale, weighted_median
from dfvs_core.servo.law import NormalEquations, servo_motion
from dfvs_core.servo.points import ServoPoints
from dfvs_core.servo.pose import GoalPose, estimate_goal_pose
from dfvs_core.servo.task import ServoTask

FAR_ANGLE_RAD = 0.15
"""Angle to the goal from which on the hybrid law goes by pose alone."""

FAR_DISTANCE = 0.15
"""Distance to the goal, over the depth of the scene, from which on it does so too."""

_CLEAR = 5.0
"""Median error, in the correspondences' expected noise, up to which a pose explains them."""

_FEWEST = 12
"""Points in a half of the view that is asked."""


def find_goal(task: ServoTask, points: ServoPoints, T_guess: FloatArray | None) -> GoalPose:
    """Goal pose near the last frame's, or else from scratch: the first that explains the points.

    Where neither does, each half of the view is asked as well, and the pose counts that most of the
    points support: what is matched wrong mostly lies together, and the rest agrees on the goal
    without it. Support alone is no good judge of two that are clear: while depth is not known it
    leans to the one that is further away.
    """
    noise, found = _noise(task), []
    for T in [None] if T_guess is None else [T_guess, None]:
        found.append(estimate_goal_pose(points, task.basis, noise, T))
        if is_clear(task, found[-1]):
            return found[-1]
    near = NoiseScale(noise.least, _CLEAR * noise.least)
    for half in _halves(points):
        T_half = estimate_goal_pose(half, task.basis, noise).T_current_goal
        found.append(estimate_goal_pose(points, task.basis, near, T_half))
    return max(found, key=lambda each: each.support)


def _noise(task: ServoTask) -> NoiseScale:
    return NoiseScale(task.config.flow_noise_px / task.camera.fx)


def is_clear(task: ServoTask, pose: GoalPose) -> bool:
    """Whether a pose explains the points to within a few times their expected noise."""
    return pose.residual <= _CLEAR * _noise(task).least


def _halves(points: ServoPoints) -> Iterator[ServoPoints]:
    """The points on the left, on the right, above and below the middle one."""
    counts = points.weight > 0.0
    for along in points.xy.T:
        middle = weighted_median(along, points.weight)
        for half in (along <= middle, along >= middle):
            if np.count_nonzero(half & counts) >= _FEWEST:
                yield points.select(half)


def wanted_motion(
    task: ServoTask, points: ServoPoints, pose: GoalPose
) -> tuple[FloatArray, NormalEquations]:
    """Motion (d,) by the configured law, with the normal equations that it stands on."""
    law = task.config.law
    z_goal = None if law == "current" else pose.z_goal_m
    motion, equations = servo_motion(points, task.basis, z_goal, task.config.damping)
    if law == "pose":
        return pose.motion, equations
    if law == "hybrid":
        depth = max(weighted_median(points.z_m, points.weight), 0.1)
        distance = float(np.linalg.norm(pose.T_current_goal[:3, 3]))
        angle = float(np.linalg.norm((task.basis.B @ pose.motion)[3:]))
        remoteness = max(angle / FAR_ANGLE_RAD, distance / depth / FAR_DISTANCE)
        motion = blend_motions(pose.motion, motion, remoteness)
    return motion, equations


def blend_motions(
    pose_motion: FloatArray, feature_motion: FloatArray, remoteness: float
) -> FloatArray:
    """Motion between two laws: by pose while far, by image features when near.

    The pose gives straight paths over large turns; the image error itself decides the last
    centimetres, where it does not depend on the depth.

    Parameters
    ----------
    pose_motion, feature_motion : (d,)
        m and rad.
    remoteness : float
        0: features alone; 1 or more: pose alone.
    """
    share = min(max(remoteness, 0.0), 1.0)
    share = share * share * (3.0 - 2.0 * share)
    return share * pose_motion + (1.0 - share) * feature_motion
