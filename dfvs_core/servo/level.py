"""Transformation to and from the gravity-aligned virtual cameras."""

from dataclasses import replace

import numpy as np

from dfvs_core.geometry.arrays import FloatArray
from dfvs_core.geometry.camera import homogeneous
from dfvs_core.geometry.interaction import interaction_matrix
from dfvs_core.geometry.poses import invert_pose, make_pose
from dfvs_core.servo.exchange import Attitude
from dfvs_core.servo.freedom import rotate_rays, virtual_rotation
from dfvs_core.servo.law import NormalEquations, normal_equations
from dfvs_core.servo.points import ServoPoints
from dfvs_core.servo.pose import GoalPose, Reprojection
from dfvs_core.servo.task import ServoTask

_TILT_INERTIA, _TILT_STIFFNESS = 0.03, 0.002
"""Weights, against that of one frame's points, of the attitude error so far and of none at all."""

_TILT_STEP_RAD = 0.002
"""Largest change of the attitude error in one frame."""

_KNOWN_SPREAD, _KNOWN_SHARE = 0.2, 0.6
"""Relative spread of a depth that is known, and share of the points whose depth must be: a tilt and
wrong depths look alike."""

_MOST_TILT_RAD = 0.06
"""Largest attitude error that is corrected; a larger one is another fault."""


def level_points(task: ServoTask, attitude: Attitude, points: ServoPoints) -> ServoPoints:
    """Points in the virtual cameras; unchanged for a free camera."""
    if task.mount is None:
        return points
    R_now, R_goal = _rotations(task, attitude)
    xy, depth_ratio, usable = rotate_rays(R_now, points.xy)
    xy_goal, _, usable_goal = rotate_rays(R_goal, points.xy_goal)
    weight = np.where(usable & usable_goal, points.weight, 0.0)
    return replace(points, xy=xy, xy_goal=xy_goal, z_m=points.z_m * depth_ratio, weight=weight)


def real_pose(task: ServoTask, attitude: Attitude, T_current_goal: FloatArray) -> FloatArray:
    """Pose (4, 4) of the current camera in the goal's, both as they are, from the virtual ones'."""
    T_goal_current = invert_pose(T_current_goal)
    if task.mount is None:
        return T_goal_current
    R_now, R_goal = (make_pose(R, np.zeros(3)) for R in _rotations(task, attitude))
    T: FloatArray = invert_pose(R_goal) @ T_goal_current @ R_now
    return T


def level_rotation(task: ServoTask, attitude: Attitude) -> FloatArray:
    """Rotation (3, 3) from the camera to the virtual camera; the identity for a free camera."""
    return np.eye(3) if task.mount is None else _rotations(task, attitude)[0]


def attitude_error(
    task: ServoTask, points: ServoPoints, pose: GoalPose, error_rad: tuple[float, float]
) -> tuple[float, float]:
    """Estimate of the error of roll and pitch (2,), rad, after one more frame.

    What the level body's motions leave of the correspondences is explained by a tilt of the current
    view against the goal's, in one Gauss-Newton step with all six degrees of freedom.

    Parameters
    ----------
    points : ServoPoints
        Levelled by ``error_rad``, with the weights of the fit.
    pose : GoalPose
        Of that fit.
    error_rad : (2,)
        Estimate so far.
    """
    assert task.mount is not None
    known = points.depth_spread < _KNOWN_SPREAD
    if float(points.weight[known].sum()) < _KNOWN_SHARE * float(points.weight.sum()):
        return error_rad
    points = points.select(known)
    R_body_camera = task.mount.T_body_camera()[:3, :3]
    P = homogeneous(points.xy) * points.z_m[:, None]
    noise = task.config.flow_noise_px / task.camera.fx
    seen = Reprojection.of(pose.T_current_goal, P, points, noise)
    tilt = np.zeros((6, 2))
    tilt[3:] = (R_body_camera @ pose.T_current_goal[:3, :3]).T[:, :2]
    J = interaction_matrix(seen.xy, seen.z_m) @ np.column_stack([task.basis.B, tilt])
    equations = normal_equations(seen.noise.whiten(J), seen.error, points.weight)
    A, b = equations.A.copy(), equations.b.copy()
    A[-2:, -2:] += (_TILT_INERTIA + _TILT_STIFFNESS) * np.eye(2)
    b[-2:] += _TILT_STIFFNESS * np.array(error_rad)
    step = np.clip(NormalEquations(A, b).solve(1e-6)[-2:], -_TILT_STEP_RAD, _TILT_STEP_RAD)
    roll, pitch = np.clip(np.add(error_rad, step), -_MOST_TILT_RAD, _MOST_TILT_RAD)
    return float(roll), float(pitch)


def _rotations(task: ServoTask, attitude: Attitude) -> tuple[FloatArray, FloatArray]:
    """Rotations (3, 3) from the camera and from the goal's to the virtual cameras."""
    assert task.mount is not None
    R_virtual = task.mount.T_body_camera()[:3, :3]
    R_now = virtual_rotation(attitude.roll_rad, attitude.pitch_rad, R_virtual, R_virtual)
    goal = task.goal
    R_goal_mount = goal.mount.T_body_camera()[:3, :3]
    return R_now, virtual_rotation(goal.roll_rad, goal.pitch_rad, R_goal_mount, R_virtual)
