"""Camera frame message: pixels as payload, header as a fixed 48-byte attachment.

The capture time is CLOCK_MONOTONIC of the machine whose boot identity stands in ``clock``:
camera and service run on the same companion computer. Routers stamp samples with their own
clock, which is why ours travels in the attachment.
"""

import enum
import struct
import uuid
import zlib
from dataclasses import dataclass

import cv2
import numpy as np

from dfvs_core.errors import ImageError, WireError
from dfvs_core.geometry.arrays import ImageArray
from dfvs_core.messages.image import decode_image, encode_jpeg, encode_png
from dfvs_core.messages.zenoh_settings import MAX_MESSAGE_BYTES

_HEADER = struct.Struct("<4sBBxxHHIQq16s")
_MAGIC = b"DFVF"
_VERSION = 1
_MAX_SIDE_PX = 0xFFFF

_ENVELOPE_BYTES = 1024
"""Room for a message's key, encoding and stamp."""

_MAX_FRAME_BYTES = MAX_MESSAGE_BYTES - _HEADER.size - _ENVELOPE_BYTES
"""Largest payload that receivers take; Zenoh drops a larger one without a word."""

NO_CLOCK = bytes(16)
"""``clock`` of a camera that does not say which clock it stamped with."""

BOOT_ID_FILE = "/proc/sys/kernel/random/boot_id"
"""Where Linux keeps the identity of the running boot."""


def clock_identity(boot_id: str) -> bytes:
    """Identity (16 bytes) of a machine's monotonic clock, from the kernel's boot id.

    Raises
    ------
    WireError
        If the text is not a UUID.
    """
    try:
        return uuid.UUID(boot_id.strip()).bytes
    except ValueError as error:
        raise WireError(f"boot id {boot_id!r}", "a UUID") from error


class PixelFormat(enum.IntEnum):
    """How the payload holds the pixels."""

    RGB8 = 0
    BGR8 = 1
    MONO8 = 2
    JPEG = 3
    PNG = 4

    @property
    def media_type(self) -> str:
        """Media type of the payload, the encoding of its Zenoh sample."""
        return _MEDIA_TYPES.get(self, "application/octet-stream")


FORMAT_NAMES = {
    "jpeg": PixelFormat.JPEG,
    "png": PixelFormat.PNG,
    "raw": PixelFormat.RGB8,
    "mono": PixelFormat.MONO8,
}
"""Formats by their names on command lines."""

_MEDIA_TYPES = {PixelFormat.JPEG: "image/jpeg", PixelFormat.PNG: "image/png"}
_CHANNELS = {PixelFormat.RGB8: 3, PixelFormat.BGR8: 3, PixelFormat.MONO8: 1}


@dataclass(frozen=True, slots=True)
class FrameHeader:
    """What is known of a frame before its pixels are touched."""

    width: int
    height: int
    pixel_format: PixelFormat
    seq: int
    t_capture_ns: int
    checksum: int
    clock: bytes = NO_CLOCK


@dataclass(frozen=True, slots=True)
class Frame:
    """A decoded frame: image (H, W, 3) uint8 RGB, its capture time and sequence number.

    ``t_arrival_ns`` is the time at which it was received, None where it did not travel.
    """

    image: ImageArray
    t_capture_ns: int
    seq: int
    t_arrival_ns: int | None = None


def encode_frame(
    frame: Frame, pixel_format: PixelFormat, clock: bytes = NO_CLOCK, quality: int = 90
) -> tuple[bytes, bytes]:
    """(payload, attachment) of a frame; ``quality`` counts for JPEG alone.

    Raises
    ------
    ImageError
        If a side has more pixels than the header can hold, or the image cannot be encoded.
    """
    height, width = frame.image.shape[:2]
    if max(height, width) > _MAX_SIDE_PX:
        raise ImageError(f"a frame of {width} x {height} px", f"at most {_MAX_SIDE_PX} px a side")
    if pixel_format is PixelFormat.JPEG:
        payload = encode_jpeg(frame.image, quality)
    elif pixel_format is PixelFormat.PNG:
        payload = encode_png(frame.image)
    elif pixel_format is PixelFormat.MONO8:
        payload = cv2.cvtColor(frame.image, cv2.COLOR_RGB2GRAY).tobytes()
    elif pixel_format is PixelFormat.BGR8:
        payload = frame.image[:, :, ::-1].tobytes()
    else:
        payload = frame.image.tobytes()
    header = FrameHeader(
        width, height, pixel_format, frame.seq, frame.t_capture_ns, zlib.crc32(payload), clock
    )
    return payload, encode_header(header)


def check_frame_size(payload: bytes) -> None:
    """Refuse the payload of a frame that no receiver takes.

    Raises
    ------
    ImageError
        If it is too large for a message.
    """
    if len(payload) > _MAX_FRAME_BYTES:
        raise ImageError(
            f"a frame has {len(payload) / 1e6:.1f} MB",
            f"at most {_MAX_FRAME_BYTES / 1e6:.1f} MB, or nobody receives it",
            "choose `--format jpeg` or a smaller `--size`",
        )


def encode_header(header: FrameHeader) -> bytes:
    """Attachment with what is known of a frame."""
    return _HEADER.pack(
        _MAGIC,
        _VERSION,
        int(header.pixel_format),
        header.width,
        header.height,
        header.checksum,
        header.seq,
        header.t_capture_ns,
        header.clock,
    )


def decode_header(attachment: bytes) -> FrameHeader:
    """Header of a frame from its attachment.

    Raises
    ------
    WireError
        If the attachment is not one of ours.
    """
    if len(attachment) != _HEADER.size:
        raise WireError(
            f"frame attachment of {len(attachment)} bytes",
            f"{_HEADER.size} bytes",
            "publish frames with dfvs_core.messages.frame.encode_frame",
        )
    magic, version, code, width, height, checksum, seq, t_ns, clock = _HEADER.unpack(attachment)
    if magic != _MAGIC or version != _VERSION:
        raise WireError(f"frame attachment {magic!r} version {version}", f"{_MAGIC!r} {_VERSION}")
    try:
        pixel_format = PixelFormat(code)
    except ValueError as error:
        raise WireError(f"pixel format {code}", "0 (RGB8) to 4 (PNG)") from error
    return FrameHeader(width, height, pixel_format, seq, t_ns, checksum, clock)


def decode_frame(payload: bytes, header: FrameHeader) -> Frame:
    """Pixels of a frame, after its size and checksum were found right.

    Raises
    ------
    WireError
        If length or checksum disagree with the header.
    ImageError
        If a compressed image cannot be decoded.
    """
    shape = (header.height, header.width)
    channels = _CHANNELS.get(header.pixel_format)
    if channels is not None and len(payload) != shape[0] * shape[1] * channels:
        raise WireError(
            f"raw frame of {len(payload)} bytes", f"{shape[1]} x {shape[0]} x {channels}"
        )
    if zlib.crc32(payload) != header.checksum:
        raise WireError("the frame's checksum does not match its bytes")
    if channels is None:
        image = decode_image(payload, max_pixels=shape[0] * shape[1])
        if image.shape[:2] != shape:
            raise WireError(f"image of {image.shape[1]} x {image.shape[0]} px", f"{shape[::-1]}")
    else:
        image = _raw_to_rgb(np.frombuffer(payload, np.uint8).reshape(*shape, channels), header)
    return Frame(image, header.t_capture_ns, header.seq)


def _raw_to_rgb(pixels: ImageArray, header: FrameHeader) -> ImageArray:
    if header.pixel_format is PixelFormat.MONO8:
        return np.repeat(pixels, 3, axis=2)
    if header.pixel_format is PixelFormat.BGR8:
        return np.ascontiguousarray(pixels[:, :, ::-1])
    return pixels
