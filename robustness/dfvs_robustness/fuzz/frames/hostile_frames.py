"""Hostile camera frames: payloads and attachments as whoever wants harm would publish them."""

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
from dfvs_robustness.fuzz.frames import image_bytes as odd
from dfvs_robustness.fuzz.random_source import RandomSource

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

    ``good`` are images of the camera's size, ``other`` those of another size, ``files`` those of
    formats that are not spoken here.
    """

    def __init__(self, rng: np.random.Generator) -> None:
        self.good = {f: _good_payload(_textured_image(rng, CAMERA.size), f) for f in PixelFormat}
        other = _textured_image(rng, OTHER_SIZE)
        self.other = {f: _good_payload(other, f) for f in _COMPRESSED}
        image = _textured_image(rng, CAMERA.size)
        self.files = [data for kind in _FILE_TYPES if (data := _encoded(kind, image))]
        flags = [cv2.IMWRITE_JPEG_PROGRESSIVE, 1, cv2.IMWRITE_JPEG_RST_INTERVAL, 7]
        self._progressive = bytes(cv2.imencode(".jpg", image, flags)[1])

    def frame(self, rng: RandomSource) -> HostileFrame:
        """One hostile frame."""
        kind, make = rng.pick(_KINDS)
        payload, attachment = make(self, rng)
        return HostileFrame(kind, payload, attachment)

    def image(self, rng: RandomSource) -> tuple[bytes, PixelFormat]:
        """Return a good compressed image, to be spoiled."""
        if rng.chance(0.25):
            return self._progressive, PixelFormat.JPEG
        chosen = rng.pick(_COMPRESSED)
        return self.good[chosen], chosen


Made = tuple[bytes, bytes]


def _textured_image(rng: np.random.Generator, size: tuple[int, int]) -> ImageArray:
    """Return a textured image (H, W, 3) uint8."""
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


def _good(corpus: Corpus, rng: RandomSource) -> Made:
    chosen = rng.pick(tuple(PixelFormat))
    return _signed(corpus.good[chosen], chosen)


def _flip(rng: RandomSource, data: bytes) -> bytes:
    """Flip up to 64 bits."""
    flipped = bytearray(data)
    for _ in range(rng.pick((1, 2, 8, 64)) if data else 0):
        flipped[rng.integer(0, len(data) - 1)] ^= 1 << rng.integer(0, 7)
    return bytes(flipped)


def _flipped_on_the_way(corpus: Corpus, rng: RandomSource) -> Made:
    chosen = rng.pick(tuple(PixelFormat))
    payload, attachment = _signed(corpus.good[chosen], chosen)
    return _flip(rng, payload), attachment


def _flipped_at_the_source(corpus: Corpus, rng: RandomSource) -> Made:
    payload, chosen = corpus.image(rng)
    return _signed(_flip(rng, payload), chosen)


def _mangled(corpus: Corpus, rng: RandomSource) -> Made:
    """Blocks of bytes left out, doubled, or overwritten."""
    payload, chosen = corpus.image(rng)
    for _ in range(rng.pick((1, 1, 4))):
        at, length = rng.integer(0, len(payload)), rng.pick((1, 2, 7, 64, 1000))
        block = rng.pick((b"", payload[at : at + length] * 2, b"\xff" * length, bytes(length)))
        payload = payload[:at] + block + payload[at + length :]
    return _signed(payload, chosen)


def _cut(corpus: Corpus, rng: RandomSource) -> Made:
    chosen = rng.pick(tuple(PixelFormat))
    payload = corpus.good[chosen]
    return _signed(payload[: rng.integer(0, len(payload) - 1)], chosen)


def _lengthened(corpus: Corpus, rng: RandomSource) -> Made:
    chosen = rng.pick(tuple(PixelFormat))
    more = rng.pick((1, 3, 1000, 1 << 20))
    return _signed(corpus.good[chosen] + rng.rng.bytes(more), chosen)


def _spliced(corpus: Corpus, rng: RandomSource) -> Made:
    head, chosen = corpus.image(rng)
    tail = corpus.image(rng)[0]
    return _signed(head[: rng.integer(0, len(head))] + tail[rng.integer(0, len(tail)) :], chosen)


def _noise(corpus: Corpus, rng: RandomSource) -> Made:
    magic = rng.pick((b"", b"\xff\xd8\xff", odd.PNG_MAGIC))
    payload = magic + odd.random_bytes(rng, 3000)
    return _signed(payload, rng.pick(tuple(PixelFormat)))


def _another_format(corpus: Corpus, rng: RandomSource) -> Made:
    """What it says it is, it is not."""
    chosen = rng.pick(tuple(PixelFormat))
    payload = rng.pick(corpus.files) if rng.chance(0.5) else corpus.good[chosen]
    return payload, attachment_for(payload, rng.integer(0, 9))


def _another_size(corpus: Corpus, rng: RandomSource) -> Made:
    if rng.chance(0.5):  # the image is not what the header says
        chosen = rng.pick(_COMPRESSED)
        size = rng.pick((CAMERA.size, OTHER_SIZE))
        payload = corpus.other[chosen]
        return payload, attachment_for(payload, chosen, size)
    chosen = rng.pick(tuple(PixelFormat))
    size = (rng.pick((0, 1, 240, 320, 321, 65535)), rng.pick((0, 1, 239, 240, 320, 65535)))
    payload = corpus.good[chosen]
    return payload, attachment_for(payload, chosen, size)


def _attachment(corpus: Corpus, rng: RandomSource) -> Made:
    payload, attachment = _good(corpus, rng)
    if rng.chance(0.4):
        return payload, _flip(rng, attachment)
    if rng.chance(0.5):
        return payload, rng.rng.bytes(rng.pick((48, 47, 49, 0, 5000)))
    return payload, (attachment * 3)[: rng.integer(0, 144)]


def _stamps(corpus: Corpus, rng: RandomSource) -> Made:
    payload = corpus.good[PixelFormat.JPEG]
    seq = rng.pick((0, 1, 2**63, 2**64 - 1))
    extremes = rng.pick(_EXTREMES)
    return payload, attachment_for(payload, PixelFormat.JPEG, t_capture_ns=extremes, seq=seq)


def _featureless(corpus: Corpus, rng: RandomSource) -> Made:
    width, height = CAMERA.size
    image = np.full((height, width, 3), rng.pick((0, 3, 128, 252, 255)), np.uint8)
    if rng.chance(0.5):
        return _signed(image.tobytes(), PixelFormat.RGB8)
    if rng.chance(0.5):
        return _signed(encode_png(image), PixelFormat.PNG)
    return _signed(encode_jpeg(image), PixelFormat.JPEG)


def _png(make: Callable[[Corpus, RandomSource], bytes]) -> Callable[[Corpus, RandomSource], Made]:
    return lambda corpus, rng: _signed(make(corpus, rng), PixelFormat.PNG)


def _jpeg(make: Callable[[Corpus, RandomSource], bytes]) -> Callable[[Corpus, RandomSource], Made]:
    return lambda corpus, rng: _signed(make(corpus, rng), PixelFormat.JPEG)


_P, _J = PixelFormat.PNG, PixelFormat.JPEG
_KINDS: tuple[tuple[str, Callable[[Corpus, RandomSource], Made]], ...] = (
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
    ("PNG of an odd kind", _png(lambda c, rng: odd.odd_png(rng, CAMERA.size))),
    ("PNG of a huge size", _png(lambda c, rng: odd.png_size_bomb(rng))),
    ("PNG with too much data", _png(lambda c, rng: odd.png_data_bomb(rng, CAMERA.size))),
    ("PNG with odd chunks", _png(lambda c, rng: odd.with_odd_chunks(rng, c.good[_P]))),
    ("PNG that is animated", _png(lambda c, rng: odd.animation(rng, c.good[_P], CAMERA.size))),
    ("JPEG with odd segments", _jpeg(lambda c, rng: odd.with_odd_segments(rng, c.good[_J]))),
    ("JPEG with an odd header", _jpeg(lambda c, rng: odd.with_odd_frame_header(rng, c.good[_J]))),
    ("JPEG with two headers", _jpeg(lambda c, rng: odd.second_frame_header(rng, c.good[_J]))),
    ("JPEG with a long way", _jpeg(lambda c, rng: odd.long_way(rng, c.good[_J]))),
    ("JPEG of many scans", _jpeg(lambda c, rng: odd.scan_bomb(rng, CAMERA.size))),
)
KINDS = tuple(name for name, _ in _KINDS)
