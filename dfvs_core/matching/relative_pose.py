"""Relative pose of two cameras, up to scale, from the flow between their images.

The essential matrix is found by the five-point algorithm (Nister, PAMI 2004) with MAGSAC++.
"""

from dataclasses import dataclass

import cv2
import numpy as np

from dfvs_core.geometry.arrays import FloatArray
from dfvs_core.geometry.camera import CameraModel, homogeneous
from dfvs_core.matching.config import MatchingConfig
from dfvs_core.matching.correspondence import FlowField
from dfvs_core.matching.smooth_flow import confident_matches

_CERTAINTY = 0.999
"""Probability with which the sampling meets inliers alone."""


@dataclass(frozen=True, slots=True)
class RelativePose:
    """Pose of the other camera in the current camera's optical frame; the distance is unknown.

    Parameters
    ----------
    R_current_other : (3, 3) float64
        Takes vectors of the other optical frame to the current one.
    direction : (3,) float64
        Unit vector from the current camera to the other one, in the current optical frame.
    parallax_rad : float
        Median angle between matched rays once the rotation is taken off. Where it is as small as
        the noise of the matches (about 0.1 degrees) the direction means nothing.
    inlier_ratio : float
        Share of the confident matches that agree on this pose, 0 to 1.
    """

    R_current_other: FloatArray
    direction: FloatArray
    parallax_rad: float
    inlier_ratio: float


def relative_pose(
    field: FlowField,
    camera: CameraModel,
    other_camera: CameraModel,
    config: MatchingConfig | None = None,
) -> RelativePose | None:
    """Pose of the other camera; None where too few confident matches agree on one.

    Parameters
    ----------
    field : FlowField
        From the current image to the other one, (H, W) at any size.
    camera, other_camera : CameraModel
        Intrinsics of both images, at any size.
    config : MatchingConfig, optional
        Gives the noise of a match, and the least number of matches.
    """
    config = config or MatchingConfig()
    height, width = field.confidence.shape
    matches = confident_matches(field)
    if len(matches) < config.least_matches:
        return None
    camera = camera.scaled(width, height)
    current = camera.normalise(matches.current + np.float64(0.5))
    other = other_camera.scaled(width, height).normalise(matches.other + np.float64(0.5))
    noise = config.noise_px / camera.fx
    try:
        E, inliers = cv2.findEssentialMat(
            current, other, np.eye(3), cv2.USAC_MAGSAC, _CERTAINTY, noise
        )
        _, R, t, inliers = cv2.recoverPose(E, current, other, np.eye(3), mask=inliers)
    except cv2.error:  # all points lead to nearly the same one, say
        return None
    agreeing = inliers.ravel() > 0
    if np.count_nonzero(agreeing) < config.least_matches:
        return None
    R_current_other = np.asarray(R, np.float64).T
    direction = -R_current_other @ np.asarray(t, np.float64).ravel()
    parallax_rad = _parallax(current[agreeing], other[agreeing], R_current_other)
    return RelativePose(R_current_other, direction, parallax_rad, float(agreeing.mean()))


def _parallax(current: FloatArray, other: FloatArray, R_current_other: FloatArray) -> float:
    """Median angle between rays (N, 2), normalised coordinates, seen from both cameras, rad."""
    first, second = homogeneous(current), homogeneous(other) @ R_current_other.T
    sine = np.linalg.norm(np.cross(first, second), axis=1)
    return float(np.median(np.arctan2(sine, (first * second).sum(axis=1))))
