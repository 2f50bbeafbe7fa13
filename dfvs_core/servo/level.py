"""To the gravity-aligned virtual cameras and back: what a tilting body would see level."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from dfvs_core.arrays import FloatArray
from dfvs_core.poses import invert_pose, make_pose
from dfvs_core.servo.exchange import Attitude
from dfvs_core.servo.freedom import rotate_rays, virtual_rotation
from dfvs_core.servo.points import ServoPoints
from dfvs_core.servo.task import ServoTask


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


def _rotations(task: ServoTask, attitude: Attitude) -> tuple[FloatArray, FloatArray]:
    """Rotations (3, 3) from the camera and from the goal's to the virtual cameras."""
    assert task.mount is not None
    R_virtual = task.mount.T_body_camera()[:3, :3]
    R_now = virtual_rotation(attitude.roll_rad, attitude.pitch_rad, R_virtual, R_virtual)
    goal = task.goal
    R_goal_mount = goal.mount.T_body_camera()[:3, :3]
    return R_now, virtual_rotation(goal.roll_rad, goal.pitch_rad, R_goal_mount, R_virtual)
