"""Conversion of sensor_msgs Image, CompressedImage and CameraInfo to the DFVS wire format."""

from dataclasses import dataclass
from typing import Any

import cv2
import numpy as np

from dfvs_core.errors import WireError
from dfvs_core.geometry.camera import CameraModel
from dfvs_core.messages.frame import PixelFormat
from dfvs_core.messages.image import MAX_IMAGE_PIXELS, image_size

_MAX_SIDE_PX = 65_535
_PIXEL_CENTRE = 0.5
"""ROS puts the first pixel's centre at 0, we at 0.5."""
_LENGTHS = {"plumb_bob": (0, 4, 5), "rational_polynomial": (8,), "": (0,)}


@dataclass(frozen=True, slots=True)
class Pixels:
    """An image's bytes in our wire format, its size in px and when it was taken by wall clock."""

    payload: bytes
    pixel_format: PixelFormat
    width: int
    height: int
    stamp_ns: int


@dataclass(frozen=True, slots=True)
class _Encoding:
    """Bytes a pixel, our format, and OpenCV's conversion to it where there is one."""

    bytes_per_pixel: int
    pixel_format: PixelFormat
    conversion: int | None = None


_RGB, _BGR, _MONO = PixelFormat.RGB8, PixelFormat.BGR8, PixelFormat.MONO8
_WITHOUT_ALPHA = cv2.COLOR_RGBA2RGB  # which drops the fourth of any order
_UYVY = _Encoding(2, _RGB, cv2.COLOR_YUV2RGB_UYVY)
_YUYV = _Encoding(2, _RGB, cv2.COLOR_YUV2RGB_YUYV)
_MONO16 = _Encoding(2, _MONO)
_ENCODINGS = {
    "rgb8": _Encoding(3, _RGB),
    "bgr8": _Encoding(3, _BGR),
    "8UC3": _Encoding(3, _BGR),
    "rgba8": _Encoding(4, _RGB, _WITHOUT_ALPHA),
    "bgra8": _Encoding(4, _BGR, _WITHOUT_ALPHA),
    "8UC4": _Encoding(4, _BGR, _WITHOUT_ALPHA),
    "mono8": _Encoding(1, _MONO),
    "8UC1": _Encoding(1, _MONO),
    "mono16": _MONO16,
    "16UC1": _MONO16,
    "yuv422": _UYVY,
    "uyvy": _UYVY,
    "yuv422_yuy2": _YUYV,
    "yuyv": _YUYV,
    "bayer_rggb8": _Encoding(1, _RGB, cv2.COLOR_BayerRGGB2RGB),
    "bayer_bggr8": _Encoding(1, _RGB, cv2.COLOR_BayerBGGR2RGB),
    "bayer_gbrg8": _Encoding(1, _RGB, cv2.COLOR_BayerGBRG2RGB),
    "bayer_grbg8": _Encoding(1, _RGB, cv2.COLOR_BayerGRBG2RGB),
}


def stamp_ns(message: Any) -> int:
    """Wall-clock time in ns of a message's header.

    Raises
    ------
    WireError
        If the header carries none.
    """
    stamp = message.header.stamp
    total = int(stamp.sec) * 1_000_000_000 + int(stamp.nanosec)
    if total <= 0 or not 0 <= stamp.nanosec < 1_000_000_000:
        raise WireError(
            f"the message's header.stamp is {stamp.sec}.{stamp.nanosec:09d}",
            "the wall-clock time of capture",
            "use a camera driver that fills in header.stamp",
        )
    return total


def from_image(message: Any) -> Pixels:
    """Take an Image apart.

    Raises
    ------
    WireError
        If its encoding is unknown, or its sizes do not fit each other.
    """
    encoding = _ENCODINGS.get(message.encoding)
    if encoding is None:
        raise WireError(
            f"ROS 2 image encoding {message.encoding[:40]!r}", f"one of {', '.join(_ENCODINGS)}"
        )
    width, height, step = int(message.width), int(message.height), int(message.step)
    row_bytes = width * encoding.bytes_per_pixel
    _check_size(width, height)
    if step < row_bytes or len(message.data) != step * height:
        raise WireError(
            f"ROS 2 image of {len(message.data)} bytes with a step of {step}",
            f"{height} rows of {row_bytes} bytes or more",
        )
    rows = message.data.reshape(height, step)[:, :row_bytes].reshape(height, width, -1)
    if encoding in (_UYVY, _YUYV) and width % 2:
        raise WireError(f"ROS 2 image {message.encoding} of {width} px", "an even width")
    if encoding is _MONO16:  # of which the high byte counts
        rows = rows[:, :, :1] if message.is_bigendian else rows[:, :, 1:]
    elif encoding.conversion is not None:
        rows = cv2.cvtColor(np.ascontiguousarray(rows), encoding.conversion)
    return Pixels(rows.tobytes(), encoding.pixel_format, width, height, stamp_ns(message))


def _check_size(width: int, height: int) -> None:
    sides = min(width, height), max(width, height)
    if sides[0] < 1 or sides[1] > _MAX_SIDE_PX or width * height > MAX_IMAGE_PIXELS:
        raise WireError(
            f"ROS 2 image of {width} x {height} px", f"at most {MAX_IMAGE_PIXELS} px in all"
        )


def from_compressed(message: Any) -> Pixels:
    """Take a CompressedImage apart; nothing is decoded.

    Raises
    ------
    ImageError
        If it is neither JPEG nor PNG.
    WireError
        If it is too large or carries no time.
    """
    payload = message.data.tobytes()
    width, height = image_size(payload)
    _check_size(width, height)
    is_png = payload.startswith(b"\x89PNG")
    pixel_format = PixelFormat.PNG if is_png else PixelFormat.JPEG
    return Pixels(payload, pixel_format, width, height, stamp_ns(message))


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
