"""Conversion of sensor_msgs/CameraInfo to a camera model."""

from typing import Any

from dfvs_core.errors import WireError
from dfvs_core.geometry.camera import CameraModel

_PIXEL_CENTRE = 0.5
"""ROS puts the first pixel's centre at 0, we at 0.5."""
_LENGTHS = {"plumb_bob": (0, 4, 5), "rational_polynomial": (8,), "": (0,)}


def camera_of(info: Any, is_rectified: bool) -> CameraModel | None:
    """Camera that a CameraInfo describes, None where it is not calibrated (K is zero).

    A rectified image is that of the projection matrix P and has no distortion any more; a raw one
    is that of K and D.

    Raises
    ------
    WireError
        If it describes a lens or a part of an image that our model cannot hold, or lacks the P of
        a rectified image.
    GeometryError
        If its numbers are no camera's.
    """
    matrix = info.p.reshape(3, 4) if is_rectified else info.k.reshape(3, 3)
    (fx, _, cx), (_, fy, cy) = matrix[:2, :3].tolist()
    if fx == 0.0:
        if info.k[0] != 0.0:
            raise WireError(
                "CameraInfo of a rectified image without a projection matrix",
                "P filled in, as camera_calibration does",
                "set the intrinsics in the settings' [camera] section",
            )
        return None
    roi = info.roi
    if max(info.binning_x, info.binning_y) > 1 or any((roi.x_offset, roi.y_offset)):
        raise WireError(
            f"CameraInfo with binning {info.binning_x} x {info.binning_y} and an offset of "
            f"({roi.x_offset}, {roi.y_offset}) px",
            "the whole image at full resolution",
        )
    return CameraModel(
        width=int(info.width),
        height=int(info.height),
        fx=fx,
        fy=fy,
        cx=cx + _PIXEL_CENTRE,
        cy=cy + _PIXEL_CENTRE,
        distortion=() if is_rectified else _distortion(info),
    )


def _distortion(info: Any) -> tuple[float, ...]:
    model, distortion = info.distortion_model, tuple(float(value) for value in info.d)
    if model not in _LENGTHS or len(distortion) not in _LENGTHS[model]:
        raise WireError(
            f"CameraInfo with {len(distortion)} coefficients of {model!r}",
            "plumb_bob or rational_polynomial",
            "take the rectified image (image_rect), or set the intrinsics in the settings' "
            "[camera] section",
        )
    return distortion if any(distortion) else ()
