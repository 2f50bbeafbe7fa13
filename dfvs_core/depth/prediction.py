"""Predicted flow from depth and a known motion."""

import cv2
import numpy as np

from dfvs_core.depth.depth_map import DepthMap
from dfvs_core.geometry.arrays import Float32Array, FloatArray
from dfvs_core.geometry.camera import CameraModel, homogeneous
from dfvs_core.matching.correspondence import FlowField

GUESS_CONFIDENCE = 0.5
_MIN_DEPTH_M = 0.1


def predict_flow(
    camera: CameraModel,
    depth: DepthMap,
    stride: int,
    T_other_current: FloatArray,
    other_camera: CameraModel | None = None,
) -> FlowField:
    """Flow from the current view to another view.

    Parameters
    ----------
    camera : CameraModel
    depth : DepthMap
        Of the current view, at every stride-th pixel: (h, w).
    stride : int
        Grid step in px.
    T_other_current : (4, 4)
        Pose of the current camera in the other one, m.
    other_camera : CameraModel, optional
        The same camera by default.

    Returns
    -------
    FlowField
        (H, W), smooth, with a confidence that calls it a guess everywhere.
    """
    pixels = camera.grid(stride)
    P = homogeneous(camera.normalise(pixels)) * depth.z_m[..., None]
    Q = P @ T_other_current[:3, :3].T + T_other_current[:3, 3]
    Q[..., 2] = np.maximum(Q[..., 2], _MIN_DEPTH_M)
    coarse = ((other_camera or camera).project(Q) - pixels).astype(np.float32)
    flow: Float32Array = np.asarray(cv2.resize(coarse, camera.size), dtype=np.float32)
    confidence = np.full(flow.shape[:2], GUESS_CONFIDENCE, dtype=np.float32)
    return FlowField(flow, confidence)
