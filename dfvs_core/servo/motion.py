"""Which motion leads to the goal: the configured law on one frame's points."""

from __future__ import annotations

import numpy as np

from dfvs_core.arrays import FloatArray
from dfvs_core.servo.law import NormalEquations, servo_motion
from dfvs_core.servo.points import ServoPoints
from dfvs_core.servo.pose import GoalPose, estimate_goal_pose
from dfvs_core.servo.task import ServoTask
from dfvs_core.servo.weights import weighted_median

FAR_ANGLE_RAD = 0.15
"""Angle to the goal from which on the hybrid law goes by pose alone."""

FAR_DISTANCE = 0.15
"""Distance to the goal, over the depth of the scene, from which on it does so too."""


def find_goal(task: ServoTask, points: ServoPoints, T_guess: FloatArray | None) -> GoalPose:
    """Goal pose from the last frame's result and from scratch; the better one counts."""
    noise = task.config.flow_noise_px / task.camera.fx
    fresh = estimate_goal_pose(points, task.basis, noise)
    if T_guess is None:
        return fresh
    warm = estimate_goal_pose(points, task.basis, noise, T_guess)
    return warm if warm.residual < fresh.residual else fresh


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
        distance, angle = distance_and_angle(task, pose)
        remoteness = max(angle / FAR_ANGLE_RAD, distance / depth / FAR_DISTANCE)
        motion = blend_motions(pose.motion, motion, remoteness)
    return motion, equations


def distance_and_angle(task: ServoTask, pose: GoalPose) -> tuple[float, float]:
    """Distance in m and angle in rad to the goal."""
    twist = task.basis.B @ pose.motion
    distance = float(np.linalg.norm(pose.T_current_goal[:3, 3]))
    return distance, float(np.linalg.norm(twist[3:]))


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
