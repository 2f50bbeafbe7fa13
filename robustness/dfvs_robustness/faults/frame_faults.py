"""Faults of the camera and its frames, of the network and of the goal."""

import functools
import itertools
import struct
import zlib
from collections.abc import Callable
from dataclasses import replace

import cv2
import numpy as np

from dfvs_core.geometry.arrays import ImageArray
from dfvs_core.messages.frame import PixelFormat, decode_header, encode_header
from dfvs_core.messages.image import encode_png
from dfvs_robustness.faults.fault import Inject
from dfvs_robustness.harness.camera import PERIOD_NS, CapturedFrame, Packet, Script, unrelated_view
from dfvs_robustness.harness.harness import Harness
from dfvs_robustness.harness.network import Misbehaviour

MS = 1_000_000
PNG = PixelFormat.PNG


_SIZE_AT, _FORMAT_AT = 8, 5
"""Offsets of the width and of the pixel format in a frame's attachment."""


def _films(make: Callable[[np.random.Generator], Script], *, first_is_good: bool = False) -> Inject:
    """Let the camera follow a script from its next frame on."""

    def inject(harness: Harness, rng: np.random.Generator) -> None:
        harness.camera.follow(make(rng), first_is_good=first_is_good)

    return inject


def _sends(change: Callable[[CapturedFrame, np.random.Generator], list[Packet]]) -> Inject:
    """Let the camera send something else of every frame."""
    return _films(lambda rng: lambda captured: change(captured, rng))


def _shows(change: Callable[[ImageArray], ImageArray]) -> Inject:
    """Let the camera show something else."""
    return _sends(lambda captured, _: [captured.showing(change(captured.image)).packet()])


def _after_first(send: Callable[[CapturedFrame, CapturedFrame], Packet]) -> Inject:
    """Let the camera send what follows from its first frame and the present one."""

    def make(rng: np.random.Generator) -> Script:
        first: list[CapturedFrame] = []

        def script(captured: CapturedFrame) -> list[Packet]:
            if not first:
                first.append(captured)
            return [send(first[0], captured)]

        return script

    return _films(make, first_is_good=True)


def _swapped_order(rng: np.random.Generator) -> Script:
    """Of three times two lie before the one that came before them: five good frames a second."""
    back_ns = itertools.cycle((3 * PERIOD_NS // 2, 5 * PERIOD_NS // 2, 0))
    return lambda captured: [replace(captured, t_ns=captured.t_ns - next(back_ns)).packet()]


def _damaged(captured: CapturedFrame, rng: np.random.Generator) -> list[Packet]:
    payload, attachment = captured.packet()
    data = bytearray(payload)
    for at in rng.integers(len(data) // 4, len(data), 20):
        data[at] ^= int(rng.integers(1, 256))
    return [(bytes(data), attachment)]


def _cut(captured: CapturedFrame, rng: np.random.Generator) -> list[Packet]:
    payload, attachment = captured.packet()
    return [(payload[: int(rng.integers(0, len(payload)))], attachment)]


def _header(attachment: bytes, at: int, code: str, *values: int) -> bytes:
    data = bytearray(attachment)
    struct.pack_into("<" + code, data, at, *values)
    return bytes(data)


def _other_size(captured: CapturedFrame, rng: np.random.Generator) -> list[Packet]:
    height, width = captured.image.shape[:2]
    factor = float(rng.choice([0.5, 2.0, 1.1]))
    other = cv2.resize(captured.image, (round(width * factor), round(height * factor)))
    return [captured.showing(np.asarray(other, np.uint8)).packet()]


def _other_format(captured: CapturedFrame, rng: np.random.Generator) -> list[Packet]:
    payload, attachment = captured.packet()
    return [(payload, _header(attachment, _FORMAT_AT, "B", int(rng.choice([0, 1, 2, 9, 255]))))]


@functools.cache
def _bomb() -> bytes:
    return encode_png(np.zeros((6000, 6000, 3), np.uint8))


def _bombs(rng: np.random.Generator) -> Script:
    """A small PNG of many pixels, said to be a small image, with its own checksum."""
    payload = _bomb()  # made here: half a second would keep the camera waiting
    checksum = zlib.crc32(payload)

    def script(captured: CapturedFrame) -> list[Packet]:
        said = decode_header(captured.packet()[1])
        header = replace(said, checksum=checksum, pixel_format=PNG)
        return [(payload, encode_header(header))]

    return script


def _flood(captured: CapturedFrame, rng: np.random.Generator) -> list[Packet]:
    """Twenty rubbish samples in place of one frame: 400 a second."""
    packets: list[Packet] = []
    for _ in range(20):
        sizes = int(rng.integers(0, 3000)), int(rng.choice([0, 16, 48, 48, 48, 200]))
        packets.append((rng.bytes(sizes[0]), rng.bytes(sizes[1])))
    return packets


def _stripes(image: ImageArray) -> ImageArray:
    """Stripes that say nothing about motion along them."""
    columns = 128 + 100 * np.sin(np.arange(image.shape[1]) / 4.0)
    return np.broadcast_to(columns[None, :, None], image.shape).astype(np.uint8)


def _misbehaves(what: Misbehaviour) -> Inject:
    def paint(image: ImageArray) -> ImageArray:
        painted = image.copy()
        painted[:, :, 2] = what.blue
        return painted

    return _shows(paint)


_SILENT = _sends(lambda _shot, _rng: [])

FRAME_FAULTS: dict[str, Inject] = {
    "camera-stops": _SILENT,
    "camera-freezes": _after_first(lambda first, now: now.showing(first.image).packet()),
    "frames-repeat": _after_first(lambda first, _: first.packet()),
    "stamps-old": _sends(lambda s, _: [replace(s, t_ns=s.t_ns - 1000 * MS).packet()]),
    "stamps-future": _sends(lambda s, _: [replace(s, t_ns=s.t_ns + 100 * MS).packet()]),
    "stamps-reordered": _films(_swapped_order),
    "other-clock": _sends(lambda s, rng: [replace(s, clock=rng.bytes(16)).packet()]),
    "wrong-size": _sends(_other_size),
    "wrong-format": _sends(_other_format),
    "wrong-colours": _shows(lambda i: i[:, :, ::-1]),
    "black": _shows(lambda i: i // 64),
    "saturated": _shows(lambda i: i // 64 + 251),
    "no-contrast": _shows(lambda i: i // 128 + 120),
    "corrupt-jpeg": _sends(_damaged),
    "truncated-jpeg": _sends(_cut),
    "image-bomb": _films(_bombs),
    "hostile-frames": _sends(_flood),
    "no-texture": _shows(_stripes),
    "goal-lost": _shows(unrelated_view),
}
"""Faults of frames that show a wall with texture."""

NETWORK_FAULTS: dict[str, Inject] = {
    "camera-stops-for-good": _SILENT,
    "network-nan": _misbehaves(Misbehaviour.NAN),
    "network-garbage": _misbehaves(Misbehaviour.GARBAGE),
    "network-unsure": _misbehaves(Misbehaviour.ONE_WAY),
    "network-slow": _misbehaves(Misbehaviour.SLOW),
    "network-stuck": _misbehaves(Misbehaviour.STUCK),
}
"""Faults beside the network that can misbehave."""
