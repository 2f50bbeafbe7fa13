"""Conversion of sensor_msgs/CameraInfo to a camera model."""

from typing import Any

from dfvs_core.errors import WireError
from dfvs_core.geometry.camera import CameraModel

_PIXEL_CENTRE = 0.5
"""ROS puts the first pixel's centre at 0, we at 0.5."""
_LENGTHS = {"plumb_bob": (0, 4, 5), "rational_polynomial": (8,), "": (0,)}


def camera_of(info: Any) -> CameraModel | None:
    """Camera that a CameraInfo describes, None where it is not calibrated (K is zero).

    Raises
    ------
    WireError
        If it describes a lens or a part of an image that our model cannot hold.
    GeometryError
        If its numbers are no camera's.
    """
    k = [float(value) for value in info.k]
    if k[0] == 0.0:
        return None
    roi = info.roi
    if max(info.binning_x, info.binning_y) > 1 or any((roi.x_offset, roi.y_offset)):
        raise WireError(
            f"CameraInfo with binning {info.binning_x} x {info.binning_y} and an offset of "
            f"({roi.x_offset}, {roi.y_offset}) px",
            "the whole image at full resolution",
        )
    model, distortion = info.distortion_model, tuple(float(value) for value in info.d)
    if model not in _LENGTHS or len(distortion) not in _LENGTHS[model]:
        raise WireError(
            f"CameraInfo with {len(distortion)} coefficients of {model!r}",
            "plumb_bob or rational_polynomial",
            "set the intrinsics in the settings' [camera] section",
        )
    if not any(distortion):
        distortion = ()
    return CameraModel(
        width=int(info.width),
        height=int(info.height),
        fx=k[0],
        fy=k[4],
        cx=k[2] + _PIXEL_CENTRE,
        cy=k[5] + _PIXEL_CENTRE,
        distortion=distortion,
    )
