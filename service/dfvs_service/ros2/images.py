"""Conversion of sensor_msgs Image and CompressedImage to the DFVS wire format."""

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import cv2
import numpy as np

from dfvs_core.errors import WireError
from dfvs_core.geometry.arrays import ImageArray
from dfvs_core.messages.frame import PixelFormat
from dfvs_core.messages.image import MAX_IMAGE_PIXELS, image_size

_MAX_SIDE_PX = 65_535


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
    """Bytes a pixel, and how rows (H, W, bytes) become our payload."""

    bytes_per_pixel: int
    pixel_format: PixelFormat
    convert: Callable[[ImageArray, bool], ImageArray]


def _as_they_are(rows: ImageArray, _is_bigendian: bool) -> ImageArray:
    return rows


def _high_byte(rows: ImageArray, is_bigendian: bool) -> ImageArray:
    return rows[:, :, :1] if is_bigendian else rows[:, :, 1:]


def _by_opencv(code: int) -> Callable[[ImageArray, bool], ImageArray]:
    def convert(rows: ImageArray, _is_bigendian: bool) -> ImageArray:
        return cv2.cvtColor(np.ascontiguousarray(rows), code).astype(np.uint8, copy=False)

    return convert


_RGB, _BGR, _MONO = PixelFormat.RGB8, PixelFormat.BGR8, PixelFormat.MONO8
_WITHOUT_ALPHA = _by_opencv(cv2.COLOR_RGBA2RGB)  # which drops the fourth of any order
_UYVY = _Encoding(2, _RGB, _by_opencv(cv2.COLOR_YUV2RGB_UYVY))
_YUYV = _Encoding(2, _RGB, _by_opencv(cv2.COLOR_YUV2RGB_YUYV))
_ENCODINGS = {
    "rgb8": _Encoding(3, _RGB, _as_they_are),
    "bgr8": _Encoding(3, _BGR, _as_they_are),
    "8UC3": _Encoding(3, _BGR, _as_they_are),
    "rgba8": _Encoding(4, _RGB, _WITHOUT_ALPHA),
    "bgra8": _Encoding(4, _BGR, _WITHOUT_ALPHA),
    "8UC4": _Encoding(4, _BGR, _WITHOUT_ALPHA),
    "mono8": _Encoding(1, _MONO, _as_they_are),
    "8UC1": _Encoding(1, _MONO, _as_they_are),
    "mono16": _Encoding(2, _MONO, _high_byte),
    "16UC1": _Encoding(2, _MONO, _high_byte),
    "yuv422": _UYVY,
    "uyvy": _UYVY,
    "yuv422_yuy2": _YUYV,
    "yuyv": _YUYV,
    "bayer_rggb8": _Encoding(1, _RGB, _by_opencv(cv2.COLOR_BayerRGGB2RGB)),
    "bayer_bggr8": _Encoding(1, _RGB, _by_opencv(cv2.COLOR_BayerBGGR2RGB)),
    "bayer_gbrg8": _Encoding(1, _RGB, _by_opencv(cv2.COLOR_BayerGBRG2RGB)),
    "bayer_grbg8": _Encoding(1, _RGB, _by_opencv(cv2.COLOR_BayerGRBG2RGB)),
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
    pixels = encoding.convert(rows, bool(message.is_bigendian))
    return Pixels(pixels.tobytes(), encoding.pixel_format, width, height, stamp_ns(message))


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
