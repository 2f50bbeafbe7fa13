"""Estimation of a camera's intrinsics from images of a calibration board."""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Literal, NamedTuple

import cv2
import numpy as np

from dfvs_core.errors import ConfigError
from dfvs_core.geometry.arrays import FloatArray
from dfvs_core.geometry.camera import CameraModel
from dfvs_service.camera.calibration.boards import BoardView

FEWEST_VIEWS = 5
_PIXEL_CENTRE = 0.5
"""OpenCV puts the first pixel's centre at 0, we at 0.5."""
_OUTLIER, _OUTLIER_PX = 3.0, 0.5
_LONGEST_LENS = 100.0
"""Focal length in image widths, half a degree of view, that only a fit without a base exceeds."""

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
    GeometryError
        If no camera can have the intrinsics that fit best.
    """
    fit = _fit(views, size, lens)
    errors_px = dict(zip((view.name for view in views), fit.errors_px, strict=True))
    limit = max(_OUTLIER * float(np.median(fit.errors_px)), _OUTLIER_PX)
    used = [view for view in views if errors_px[view.name] <= limit]
    if len(used) < len(views):
        fit = _fit(used, size, lens)
        errors_px |= zip((view.name for view in used), fit.errors_px, strict=True)
    names = {view.name for view in used}
    judged = tuple(
        ViewError(view.name, errors_px[view.name], len(view.pixels), view.name in names)
        for view in views
    )
    return Calibration(fit.camera(size), fit.rms_px, judged, fit.deviations_px)


class _Fit(NamedTuple):
    """What OpenCV finds: errors are those of the views, deviations those of fx, fy, cx, cy, px."""

    rms_px: float
    K: FloatArray
    distortion: tuple[float, ...]
    errors_px: list[float]
    deviations_px: tuple[float, float, float, float]

    def camera(self, size: tuple[int, int]) -> CameraModel:
        """The camera in our pixel convention."""
        cx, cy = (float(value) + _PIXEL_CENTRE for value in self.K[:2, 2])
        return CameraModel(*size, float(self.K[0, 0]), float(self.K[1, 1]), cx, cy, self.distortion)


def _fit(views: Sequence[BoardView], size: tuple[int, int], lens: Lens) -> _Fit:
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
    fx, fy, cx, cy = (float(value) for value in np.asarray(deviations).reshape(-1)[:4])
    is_finite = bool(np.isfinite([rms, fx, fy, cx, cy]).all())
    if not is_finite or max(K[0, 0], K[1, 1]) > _LONGEST_LENS * size[0]:
        raise ConfigError("the images fix no camera", "boards at different tilts")
    coefficients = np.asarray(distortion).reshape(-1)[: _COEFFICIENTS[lens]]
    return _Fit(
        float(rms),
        np.asarray(K),
        tuple(float(value) for value in coefficients),
        [float(error) for error in np.asarray(errors).reshape(-1)],
        (fx, fy, cx, cy),
    )
