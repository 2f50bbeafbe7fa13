"""Pose that follows from a flow and the true depth of the current view."""

import cv2
import numpy as np

from dfvs_bench.methods.pnp import GRID, REPROJECTION_PX, confident_points, perspective_pose
from dfvs_core.depth.depth_map import DepthMap
from dfvs_core.geometry.arrays import Float32Array, FloatArray
from dfvs_core.geometry.camera import CameraModel
from dfvs_core.matching.correspondence import FlowField
from dfvs_core.servo.config import ServoConfig

_WIDTH_PX = 320.0
"""Width of the image at which a reprojection within ``REPROJECTION_PX`` agrees."""


def pose_with_depth(
    flow: FlowField, depth_m: Float32Array, camera: CameraModel
) -> FloatArray | None:
    """``T_current_goal`` (4, 4), m, by the flow from the current view to the goal.

    None where the service would refuse the frame: too few of the points are confident, or too few
    of those agree on a pose.

    Parameters
    ----------
    flow : FlowField
        At the matcher's working size.
    depth_m : (H, W)
        Of the current view; 0 is sky.
    camera : CameraModel
        Of the depth.
    """
    config = ServoConfig()
    height, width = flow.confidence.shape
    camera = camera.scaled(width, height)
    depth_m = np.asarray(cv2.resize(depth_m, (width, height), interpolation=cv2.INTER_NEAREST))
    depth = DepthMap(np.maximum(depth_m, np.float32(1e-3)), (depth_m > 0).astype(np.float32))
    P, xy_goal = confident_points(flow, depth, camera)
    if len(P) < config.min_overlap * depth_m[GRID, GRID].size:
        return None
    tolerance = REPROJECTION_PX * camera.width / _WIDTH_PX / camera.fx
    pose = perspective_pose(P, xy_goal, tolerance)
    if pose is None or len(pose[1]) < config.min_inliers * len(P):
        return None
    return pose[0]
