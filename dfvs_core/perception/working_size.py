"""Servo task and depth at the working size of the flow."""

from __future__ import annotations

from dataclasses import replace

import cv2
import numpy as np

from dfvs_core.matching.correspondence import DepthMap
from dfvs_core.perception.goal_preview import GoalView
from dfvs_core.servo.task import ServoTask


def with_goal(task: ServoTask, goal: GoalView) -> ServoTask:
    """The task at the working size, with the depth of its goal."""
    return replace(at_working_size(task, goal), goal_depth=goal.depth())


def at_working_size(task: ServoTask, goal: GoalView) -> ServoTask:
    """The task with both cameras at the size (height, width) of the flow fields."""
    height, width = goal.features.size
    cameras = (camera.scaled(width, height) for camera in (task.camera, task.goal.camera))
    camera, goal_camera = cameras
    return replace(task, camera=camera, goal=replace(task.goal, camera=goal_camera))


def resized_depth(depth: DepthMap, size: tuple[int, int]) -> DepthMap:
    """Depth of an image at ``size`` (height, width), by the nearest pixel."""
    z_m, validity = (
        np.asarray(cv2.resize(v, size[::-1], interpolation=cv2.INTER_NEAREST_EXACT), np.float32)
        for v in (depth.z_m, depth.validity)
    )
    return DepthMap(z_m, validity)
