"""Estimation of a camera's intrinsics from images of a calibration board."""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Literal

import cv2
import numpy as np

from dfvs_core.errors import ConfigError
from dfvs_core.geometry.camera import CameraModel
from dfvs_service.camera.calibration.boards import BoardView

FEWEST_VIEWS = 5
_PIXEL_CENTRE = 0.5
"""OpenCV puts the first pixel's centre at 0, we at 0.5."""
_OUTLIER, _OUTLIER_PX = 3.0, 0.5

Lens = Literal["pinhole", "plumb_bob", "rational"]
_FLAGS = {
    "pinhole": cv2.CALIB_ZERO_TANGENT_DIST | cv2.CALIB_FIX_K1 | cv2.CALIB_FIX_K2 | cv2.CALIB_FIX_K3,
    "plumb_bob": 0,
    "rational": cv2.CALIB_RATIONAL_MODEL,
}
_COEFFICIENTS = {"pinhole": 0, "plumb_bob": 5, "rational": 8}


@dataclass(frozen=True, slots=True)
class ViewError:
    """How well one image fits: root mean square reprojection error in px."""

    name: str
    error_px: float
    corners: int
    is_used: bool


@dataclass(frozen=True, slots=True)
class Calibration:
    """Result: the camera, root mean square error in px, every image's, and uncertainties in px.

    ``deviations_px`` are the standard deviations of fx, fy, cx, cy.
    """

    camera: CameraModel
    rms_px: float
    views: tuple[ViewError, ...]
    deviations_px: tuple[float, float, float, float]

    def doubts(self) -> list[str]:
        """Reasons not to trust it; empty where there is none."""
        lines = []
        if self.rms_px > 1.0:
            lines.append(
                f"the error of {self.rms_px:.2f} px is large: is the board flat, and of that size?"
            )
        if max(self.deviations_px[:2]) > 0.01 * self.camera.fx:
            lines.append("the focal length is uncertain by more than 1 %: tilt the board more")
        left_out = sum(not view.is_used for view in self.views)
        if left_out:
            lines.append(f"{left_out} images did not fit and were left out")
        return lines


def calibrate(views: Sequence[BoardView], size: tuple[int, int], lens: Lens) -> Calibration:
    """Fit a camera to images of (width, height) px; one that does not fit is left out, once.

    Raises
    ------
    ConfigError
        If there are too few images, or they fix no camera.
    """
    first = _fit(views, size, lens)
    errors_px = [view.error_px for view in first.views]
    limit = max(_OUTLIER * float(np.median(errors_px)), _OUTLIER_PX)
    used = [view for view, e in zip(views, errors_px, strict=True) if e <= limit]
    if len(used) == len(views):
        return first
    fit = _fit(used, size, lens)
    by_name = {view.name: view for view in fit.views}
    judged = (by_name.get(view.name, replace(view, is_used=False)) for view in first.views)
    return replace(fit, views=tuple(judged))


def _fit(views: Sequence[BoardView], size: tuple[int, int], lens: Lens) -> Calibration:
    if len(views) < FEWEST_VIEWS:
        raise ConfigError(
            f"{len(views)} usable images of the board",
            f"{FEWEST_VIEWS} or more",
            "take more, with the whole board sharp and well lit, and check --board",
        )
    try:
        rms, K, distortion, _, _, deviations, _, errors = cv2.calibrateCameraExtended(
            [view.points_m for view in views],
            [view.pixels for view in views],
            size,
            np.eye(3),
            np.zeros(_COEFFICIENTS[lens] or 5),
            flags=_FLAGS[lens],
        )
    except cv2.error as error:
        raise ConfigError(
            f"the images fix no camera ({error.err})", "boards at different tilts"
        ) from error
    if not np.isfinite(rms):
        raise ConfigError("the images fix no camera", "boards at different tilts")
    coefficients = np.asarray(distortion).reshape(-1)[: _COEFFICIENTS[lens]]
    camera = CameraModel(
        size[0],
        size[1],
        float(K[0, 0]),
        float(K[1, 1]),
        float(K[0, 2]) + _PIXEL_CENTRE,
        float(K[1, 2]) + _PIXEL_CENTRE,
        tuple(float(value) for value in coefficients),
    )
    fx, fy, cx, cy = (float(value) for value in np.asarray(deviations).reshape(-1)[:4])
    judged = tuple(
        ViewError(view.name, float(error), len(view.pixels), is_used=True)
        for view, error in zip(views, np.asarray(errors).reshape(-1), strict=True)
    )
    return Calibration(camera, float(rms), judged, (fx, fy, cx, cy))
