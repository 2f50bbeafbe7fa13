"""Hostile camera frames: payloads and attachments as whoever wants harm would publish them."""

from __future__ import annotations

import struct
import zlib
from collections.abc import Callable
from dataclasses import dataclass

import cv2
import numpy as np

from dfvs_core.geometry.arrays import ImageArray
from dfvs_core.geometry.camera import CameraModel
from dfvs_core.messages.frame import Frame, PixelFormat, encode_frame
from dfvs_core.messages.image import encode_jpeg, encode_png
from dfvs_robustness.fuzz import image_bytes as odd
from dfvs_robustness.fuzz.random_source import Dice

CLOCK = b"the-clock-of-it."
NOW_NS = 1_000_000_000_000
CAMERA = CameraModel.from_horizontal_fov(320, 240, 1.3)
OTHER_SIZE = (322, 242)

_ATTACHMENT = struct.Struct("<4sBBxxHHIQq16s")
_COMPRESSED = (PixelFormat.JPEG, PixelFormat.PNG)
_EXTREMES = (-(2**63), -1, 0, 1, NOW_NS, NOW_NS - 10**9, NOW_NS + 10**9, 2**63 - 1)
_FILE_TYPES = (".bmp", ".tiff", ".webp", ".jp2", ".gif", ".ppm", ".pbm", ".hdr", ".ras", ".avif")


@dataclass(frozen=True, slots=True)
class HostileFrame:
    """Bytes as they arrive, and by which trick they were made."""

    kind: str
    payload: bytes
    attachment: bytes


def attachment_for(
    payload: bytes,
    pixel_format: int,
    size: tuple[int, int] = CAMERA.size,
    t_capture_ns: int = NOW_NS - 20_000_000,
    seq: int = 1,
) -> bytes:
    """Attachment whose checksum fits the payload: the sender knows the format well."""
    checksum = zlib.crc32(payload)
    head = (b"DFVF", 1, pixel_format, *size, checksum, seq, t_capture_ns, CLOCK)
    return _ATTACHMENT.pack(*head)


class Corpus:
    """Makes hostile frames out of a few good ones.

    Parameters
    ----------
    rng : np.random.Generator
        Draws the good pictures.
    """

    def __init__(self, rng: np.random.Generator) -> None:
        self.good = {f: _good_payload(_picture(rng, CAMERA.size), f) for f in PixelFormat}
        other = _picture(rng, OTHER_SIZE)
        self._other = {f: _good_payload(other, f) for f in _COMPRESSED}
        picture = _picture(rng, CAMERA.size)
        self._files = [data for kind in _FILE_TYPES if (data := _encoded(kind, picture))]
        flags = [cv2.IMWRITE_JPEG_PROGRESSIVE, 1, cv2.IMWRITE_JPEG_RST_INTERVAL, 7]
        self._progressive = bytes(cv2.imencode(".jpg", picture, flags)[1])

    def frame(self, dice: Dice) -> HostileFrame:
        """One hostile frame."""
        kind, make = dice.pick(_KINDS)
        payload, attachment = make(self, dice)
        return HostileFrame(kind, payload, attachment)

    def picture(self, dice: Dice) -> tuple[bytes, PixelFormat]:
        """Return a good compressed picture, to be spoiled."""
        if dice.chance(0.25):
            return self._progressive, PixelFormat.JPEG
        chosen = dice.pick(_COMPRESSED)
        return self.good[chosen], chosen

    def other(self, chosen: PixelFormat) -> bytes:
        """Return a good picture of another size than the camera's."""
        return self._other[chosen]

    def file(self, dice: Dice) -> bytes:
        """Return a picture of a format that is not spoken here."""
        return dice.pick(self._files)


Made = tuple[bytes, bytes]


def _picture(rng: np.random.Generator, size: tuple[int, int]) -> ImageArray:
    """Return a textured picture (H, W, 3) uint8."""
    coarse = rng.integers(0, 256, (size[1] // 8, size[0] // 8, 3)).astype(np.uint8)
    smooth = cv2.resize(coarse, size, interpolation=cv2.INTER_CUBIC)
    return np.ascontiguousarray(smooth)


def _good_payload(image: ImageArray, pixel_format: PixelFormat) -> bytes:
    return encode_frame(Frame(image, 0, 0), pixel_format)[0]


def _encoded(kind: str, image: ImageArray) -> bytes:
    """File of a type, empty where this OpenCV cannot write it."""
    try:
        ok, data = cv2.imencode(kind, image)
    except cv2.error:
        return b""
    return bytes(data) if ok else b""


def _signed(payload: bytes, pixel_format: PixelFormat) -> Made:
    return payload, attachment_for(payload, pixel_format)


def _good(corpus: Corpus, dice: Dice) -> Made:
    chosen = dice.pick(tuple(PixelFormat))
    return _signed(corpus.good[chosen], chosen)


def _flip(dice: Dice, data: bytes) -> bytes:
    """Flip up to 64 bits."""
    flipped = bytearray(data)
    for _ in range(dice.pick((1, 2, 8, 64)) if data else 0):
        flipped[dice.integer(0, len(data) - 1)] ^= 1 << dice.integer(0, 7)
    return bytes(flipped)


def _flipped_on_the_way(corpus: Corpus, dice: Dice) -> Made:
    chosen = dice.pick(tuple(PixelFormat))
    payload, attachment = _signed(corpus.good[chosen], chosen)
    return _flip(dice, payload), attachment


def _flipped_at_the_source(corpus: Corpus, dice: Dice) -> Made:
    payload, chosen = corpus.picture(dice)
    return _signed(_flip(dice, payload), chosen)


def _mangled(corpus: Corpus, dice: Dice) -> Made:
    """Blocks of bytes left out, doubled, or overwritten."""
    payload, chosen = corpus.picture(dice)
    for _ in range(dice.pick((1, 1, 4))):
        at, length = dice.integer(0, len(payload)), dice.pick((1, 2, 7, 64, 1000))
        block = dice.pick((b"", payload[at : at + length] * 2, b"\xff" * length, bytes(length)))
        payload = payload[:at] + block + payload[at + length :]
    return _signed(payload, chosen)


def _cut(corpus: Corpus, dice: Dice) -> Made:
    chosen = dice.pick(tuple(PixelFormat))
    payload = corpus.good[chosen]
    return _signed(payload[: dice.integer(0, len(payload) - 1)], chosen)


def _lengthened(corpus: Corpus, dice: Dice) -> Made:
    chosen = dice.pick(tuple(PixelFormat))
    more = dice.pick((1, 3, 1000, 1 << 20))
    return _signed(corpus.good[chosen] + dice.rng.bytes(more), chosen)


def _spliced(corpus: Corpus, dice: Dice) -> Made:
    head, chosen = corpus.picture(dice)
    tail = corpus.picture(dice)[0]
    return _signed(head[: dice.integer(0, len(head))] + tail[dice.integer(0, len(tail)) :], chosen)


def _noise(corpus: Corpus, dice: Dice) -> Made:
    magic = dice.pick((b"", b"\xff\xd8\xff", odd.PNG_MAGIC))
    payload = magic + odd.random_bytes(dice, 3000)
    return _signed(payload, dice.pick(tuple(PixelFormat)))


def _another_format(corpus: Corpus, dice: Dice) -> Made:
    """What it says it is, it is not."""
    chosen = dice.pick(tuple(PixelFormat))
    payload = corpus.file(dice) if dice.chance(0.5) else corpus.good[chosen]
    return payload, attachment_for(payload, dice.integer(0, 9))


def _another_size(corpus: Corpus, dice: Dice) -> Made:
    if dice.chance(0.5):  # the picture is not what the header says
        chosen = dice.pick(_COMPRESSED)
        size = dice.pick((CAMERA.size, OTHER_SIZE))
        return corpus.other(chosen), attachment_for(corpus.other(chosen), chosen, size)
    chosen = dice.pick(tuple(PixelFormat))
    size = (dice.pick((0, 1, 240, 320, 321, 65535)), dice.pick((0, 1, 239, 240, 320, 65535)))
    payload = corpus.good[chosen]
    return payload, attachment_for(payload, chosen, size)


def _attachment(corpus: Corpus, dice: Dice) -> Made:
    payload, attachment = _good(corpus, dice)
    if dice.chance(0.4):
        return payload, _flip(dice, attachment)
    if dice.chance(0.5):
        return payload, dice.rng.bytes(dice.pick((48, 47, 49, 0, 5000)))
    return payload, (attachment * 3)[: dice.integer(0, 144)]


def _stamps(corpus: Corpus, dice: Dice) -> Made:
    payload = corpus.good[PixelFormat.JPEG]
    seq = dice.pick((0, 1, 2**63, 2**64 - 1))
    extremes = dice.pick(_EXTREMES)
    return payload, attachment_for(payload, PixelFormat.JPEG, t_capture_ns=extremes, seq=seq)


def _featureless(corpus: Corpus, dice: Dice) -> Made:
    width, height = CAMERA.size
    image = np.full((height, width, 3), dice.pick((0, 3, 128, 252, 255)), np.uint8)
    if dice.chance(0.5):
        return _signed(image.tobytes(), PixelFormat.RGB8)
    if dice.chance(0.5):
        return _signed(encode_png(image), PixelFormat.PNG)
    return _signed(encode_jpeg(image), PixelFormat.JPEG)


def _png(make: Callable[[Corpus, Dice], bytes]) -> Callable[[Corpus, Dice], Made]:
    return lambda corpus, dice: _signed(make(corpus, dice), PixelFormat.PNG)


def _jpeg(make: Callable[[Corpus, Dice], bytes]) -> Callable[[Corpus, Dice], Made]:
    return lambda corpus, dice: _signed(make(corpus, dice), PixelFormat.JPEG)


_P, _J = PixelFormat.PNG, PixelFormat.JPEG
_KINDS: tuple[tuple[str, Callable[[Corpus, Dice], Made]], ...] = (
    ("good", _good),
    ("flipped on the way", _flipped_on_the_way),
    ("flipped at the source", _flipped_at_the_source),
    ("mangled", _mangled),
    ("cut short", _cut),
    ("lengthened", _lengthened),
    ("spliced", _spliced),
    ("noise", _noise),
    ("another format", _another_format),
    ("another size", _another_size),
    ("attachment", _attachment),
    ("stamps", _stamps),
    ("featureless", _featureless),
    ("PNG of an odd kind", _png(lambda c, dice: odd.odd_png(dice, CAMERA.size))),
    ("PNG of a huge size", _png(lambda c, dice: odd.png_size_bomb(dice))),
    ("PNG with too much data", _png(lambda c, dice: odd.png_data_bomb(dice, CAMERA.size))),
    ("PNG with odd chunks", _png(lambda c, dice: odd.with_odd_chunks(dice, c.good[_P]))),
    ("PNG that is animated", _png(lambda c, dice: odd.animation(dice, c.good[_P], CAMERA.size))),
    ("JPEG with odd segments", _jpeg(lambda c, dice: odd.with_odd_segments(dice, c.good[_J]))),
    ("JPEG with an odd header", _jpeg(lambda c, dice: odd.with_odd_frame_header(dice, c.good[_J]))),
    ("JPEG with two headers", _jpeg(lambda c, dice: odd.second_frame_header(dice, c.good[_J]))),
    ("JPEG with a long way", _jpeg(lambda c, dice: odd.long_way(dice, c.good[_J]))),
    ("JPEG of many scans", _jpeg(lambda c, dice: odd.scan_bomb(dice, CAMERA.size))),
)
KINDS = tuple(name for name, _ in _KINDS)
