"""Decoding of JPEG and PNG images with a size check on the header; encoding.

A few hundred bytes of PNG can unfold to a gigabyte, so no byte is decoded before the header's
size was found acceptable. Some kinds of images take time instead of memory and are refused as
well: a JPEG of very many scans or segments, and a PNG whose data unfold to more than its pixels.
"""

from __future__ import annotations

import re
import struct
import zlib

import cv2
import numpy as np

from dfvs_core.errors import ImageError
from dfvs_core.geometry.arrays import ImageArray

MAX_IMAGE_BYTES = 32 * 1024 * 1024
MAX_IMAGE_PIXELS = 16 * 1024 * 1024

_PNG_MAGIC = b"\x89PNG\r\n\x1a\n"
_PNG_HEAD_BYTES = 33
_PNG_PIXEL_CHUNKS = frozenset({b"PLTE", b"IDAT", b"IEND"})
_PNG_PIXEL_BYTES, _PNG_LINE_BYTES = 8, 16
"""Four channels of 16 bits; a filter byte a line, for every pass of an interlaced one."""
_INFLATE_BYTES = 1 << 16
_MAX_PNG_CHUNKS = 8192
_LEAST_16_BIT_PEAK = 4096
"""Values of 12 bits or fewer are below; the high byte of 16 would hold next to nothing of them."""
_JPEG_MAGIC = b"\xff\xd8\xff"
_JPEG_SIZE_MARKERS = frozenset({0xC0, 0xC1, 0xC2})
"""Baseline, extended and progressive, Huffman coded: what cameras send."""
_JPEG_OTHER_SIZE_MARKERS = frozenset(range(0xC3, 0xD0)) - {0xC4, 0xC8, 0xCC}
_JPEG_SCAN = b"\xff\xda"
_MAX_JPEG_SCANS = 64
"""Usual progressive images have ten; every scan walks all blocks again for a dozen bytes."""
_JPEG_FILL = re.compile(rb"\xff+")
"""A marker may be preceded by any number of them."""
_MAX_JPEG_SEGMENTS = 1024
_JPEG_BARE_MARKERS = frozenset({0x01, *range(0xD0, 0xD8)})


def image_size(data: bytes) -> tuple[int, int]:
    """(width, height) in px from the header of a PNG or JPEG, nothing decoded.

    Raises
    ------
    ImageError
        If the data is neither, or its header is broken.
    """
    if data.startswith(_PNG_MAGIC):
        if len(data) < 24 or data[12:16] != b"IHDR":
            raise ImageError("the PNG header is cut short")
        width, height = struct.unpack(">II", data[16:24])
        return int(width), int(height)
    if data.startswith(_JPEG_MAGIC):
        return _jpeg_size(data)
    raise ImageError(f"the data begins with {data[:8]!r}", "a PNG or JPEG image")


def _jpeg_size(data: bytes) -> tuple[int, int]:
    """Walk the segments of a JPEG to its frame header."""
    at = 2
    for _ in range(_MAX_JPEG_SEGMENTS):
        fill = _JPEG_FILL.match(data, at)
        at = at if fill is None else fill.end() - 1
        if at + 9 > len(data):
            raise ImageError("the JPEG header is cut short")
        if fill is None:
            raise ImageError("the JPEG header is damaged")
        marker = data[at + 1]
        if marker in _JPEG_BARE_MARKERS:
            at += 2
        elif marker in _JPEG_SIZE_MARKERS:
            height, width = struct.unpack(">HH", data[at + 5 : at + 9])
            return int(width), int(height)
        elif marker in _JPEG_OTHER_SIZE_MARKERS:
            raise ImageError(f"JPEG of kind 0x{marker:02X}", "a baseline or progressive JPEG")
        else:
            at += 2 + int.from_bytes(data[at + 2 : at + 4], "big")
    raise ImageError("the JPEG header has too many segments", f"at most {_MAX_JPEG_SEGMENTS}")


def decode_image(data: bytes, max_pixels: int = MAX_IMAGE_PIXELS) -> ImageArray:
    """Decode a PNG or JPEG to (H, W, 3) uint8 RGB.

    Raises
    ------
    ImageError
        If the image is too large, damaged, or not PNG or JPEG, or values of fewer bits are in a
        PNG of 16.
    """
    if len(data) > MAX_IMAGE_BYTES:
        remedy = "save it as JPEG, or with fewer pixels"
        raise ImageError(f"image of {len(data)} bytes", f"at most {MAX_IMAGE_BYTES}", remedy)
    width, height = image_size(data)
    if width < 1 or height < 1 or width * height > max_pixels:
        raise ImageError(f"image of {width} x {height} px", f"at most {max_pixels} px in all")
    if data.startswith(_PNG_MAGIC):
        data = _png_pixels(data, width, height)
    elif data.count(_JPEG_SCAN) > _MAX_JPEG_SCANS:
        raise ImageError(f"JPEG of {data.count(_JPEG_SCAN)} scans", f"at most {_MAX_JPEG_SCANS}")
    # Pixels stay where the sensor had them: a note on how to turn the image must not count.
    flags = cv2.IMREAD_COLOR | cv2.IMREAD_ANYDEPTH | cv2.IMREAD_IGNORE_ORIENTATION
    try:
        bgr = cv2.imdecode(np.frombuffer(data, np.uint8), flags)
    except cv2.error as error:
        raise ImageError(f"the image cannot be decoded ({error.err})") from error
    if bgr is None or bgr.shape[:2] != (height, width) or bgr.dtype not in (np.uint8, np.uint16):
        raise ImageError("the image cannot be decoded", f"{width} x {height} px, 8 or 16 bit")
    if bgr.dtype == np.uint16:
        bgr = _high_byte(bgr)
    return np.ascontiguousarray(bgr[:, :, ::-1])


def _high_byte(pixels: cv2.typing.MatLike) -> ImageArray:
    """Bring an image (H, W, 3) of 16 bits to 8, where it uses its 16."""
    if (peak := int(pixels.max())) < _LEAST_16_BIT_PEAK:
        raise ImageError(
            f"a PNG of 16 bits whose largest value is {peak}",
            f"{_LEAST_16_BIT_PEAK} to 65535",
            "save it with 8 bits, or multiply its values: those of 12 bits by 16",
        )
    return (pixels // 256).astype(np.uint8)


def _png_pixels(data: bytes, width: int, height: int) -> bytes:
    """PNG of those chunks alone that hold pixels: profiles, texts and animations unfold as well.

    Raises
    ------
    ImageError
        If it is cut short, or its data unfold to more than its pixels can take.
    """
    parts = [data[:_PNG_HEAD_BYTES]]
    left = height * (width * _PNG_PIXEL_BYTES + _PNG_LINE_BYTES)
    inflater = zlib.decompressobj()
    at = _PNG_HEAD_BYTES
    for _ in range(_MAX_PNG_CHUNKS):
        length, kind = int.from_bytes(data[at : at + 4], "big"), data[at + 4 : at + 8]
        if at + length + 12 > len(data):
            raise ImageError("the PNG is cut short")
        if kind == b"IDAT":
            left -= _unfolded_bytes(inflater, data[at + 8 : at + 8 + length], left)
        if kind in _PNG_PIXEL_CHUNKS:
            parts.append(data[at : at + length + 12])
        if kind == b"IEND":
            return b"".join(parts)
        at += length + 12
    raise ImageError("the PNG has too many chunks", f"at most {_MAX_PNG_CHUNKS}")


def _unfolded_bytes(inflater: zlib._Decompress, part: bytes, most: int) -> int:
    """Length of what a part of a zlib stream unfolds to; nothing of it is kept."""
    total = 0
    try:
        while part and not inflater.eof:
            total += len(inflater.decompress(part, _INFLATE_BYTES))
            part = inflater.unconsumed_tail
            if total > most:
                raise ImageError("the PNG unfolds to more bytes than its pixels", f"{most}")
    except zlib.error as error:
        raise ImageError(f"the PNG is damaged ({error})") from error
    return total


def encode_jpeg(image: ImageArray, quality: int = 90) -> bytes:
    """JPEG of an image (H, W, 3) uint8 RGB; quality 1 to 100.

    Raises
    ------
    ImageError
        If the image cannot be encoded, as one of no pixels.
    """
    return _encode("JPEG", image, [cv2.IMWRITE_JPEG_QUALITY, quality])


def encode_png(image: ImageArray) -> bytes:
    """PNG of an image (H, W, 3) uint8 RGB.

    Raises
    ------
    ImageError
        If the image cannot be encoded, as one of no pixels.
    """
    return _encode("PNG", image, [])


def _encode(kind: str, image: ImageArray, parameters: list[int]) -> bytes:
    try:
        ok, data = cv2.imencode(f".{kind.lower()}", image[:, :, ::-1], parameters)
    except cv2.error as error:
        raise ImageError(
            f"an image of shape {image.shape} cannot be encoded as {kind} ({error.err})"
        ) from error
    if not ok:
        raise ImageError(f"an image of shape {image.shape} cannot be encoded as {kind}")
    return bytes(data)
