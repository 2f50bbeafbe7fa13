"""Faults of the camera and its frames, of the network and of the goal."""

import functools
import itertools
import struct
import zlib
from collections.abc import Callable
from dataclasses import replace

import cv2
import numpy as np

from dfvs_core.gate.states import Cause, GateState
from dfvs_core.geometry.arrays import ImageArray
from dfvs_core.messages.frame import PixelFormat, decode_header, encode_header
from dfvs_core.messages.image import encode_png
from dfvs_robustness.faults.fault import (
    CAPTURE_MS,
    READY_OR_ENGAGED,
    Fault,
    Inject,
    Reaction,
    fault,
)
from dfvs_robustness.harness.camera import PERIOD_NS, CapturedFrame, Packet, Script, unrelated_view
from dfvs_robustness.harness.harness import Harness
from dfvs_robustness.harness.network import Misbehaviour
from dfvs_robustness.harness.setup import TEXTURE, Setup

S = GateState
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


def _hold(name: str, what: str, seen_by: str, inject: Inject, setup: Setup = TEXTURE) -> Fault:
    hold, says = Reaction.HOLD, _SAYS[name]
    return Fault(name, what, seen_by, hold, CAPTURE_MS, READY_OR_ENGAGED, inject, setup, says=says)


def _abort(name: str, what: str, seen_by: str, inject: Inject, limit_ms: float) -> Fault:
    held = (Cause.HOLD_TOO_LONG,)
    return Fault(name, what, seen_by, Reaction.ABORT, limit_ms, (S.SERVO,), inject, says=held)


_UNREADABLE, _LOW_OVERLAP = "the frame cannot be read", "too little of the view shows the goal"
_SAYS: dict[str, tuple[str, ...]] = {
    "camera-stops": ("no camera frame",),
    "camera-freezes": ("repeats the same image",),
    "frames-repeat": ("not newer than the one before", "old when it arrived"),
    "stamps-old": ("old when it arrived",),
    "stamps-future": ("still to come",),
    "stamps-reordered": ("not newer than the one before",),
    "other-clock": ("another machine's clock",),
    "wrong-size": ("size is not the camera's",),
    "wrong-format": (_UNREADABLE,),
    "wrong-colours": ("red and blue are exchanged",),
    "black": ("the image is black",),
    "saturated": ("the image is white",),
    "no-contrast": ("no contrast",),
    "corrupt-jpeg": ("checksum",),
    "truncated-jpeg": ("checksum",),
    "image-bomb": (_UNREADABLE, "size is not the camera's"),
    "hostile-frames": (_UNREADABLE,),
    "no-texture": (_LOW_OVERLAP, "repeats the same image"),
    "goal-lost": (_LOW_OVERLAP,),
    "network-nan": (_LOW_OVERLAP,),
    "network-garbage": (_LOW_OVERLAP,),
    "network-unsure": (_LOW_OVERLAP,),
    "network-slow": (Cause.FRAME_OLD, Cause.RESULT_LATE),
}
"""What the gate must give as its reason for each fault that leads to HOLD."""


def frame_faults() -> tuple[Fault, ...]:
    """Faults of frames, by the rows of the table."""
    silent = _sends(lambda _shot, _rng: [])
    dead_network = fault(
        ("network-stuck", "network does not return", "no report: frame age"),
        (Reaction.ABORT, 3700.0, (S.SERVO,), _misbehaves(Misbehaviour.STUCK)),
        restarts=True,
        says=(Cause.HOLD_TOO_LONG,),
    )
    return (
        _hold("camera-stops", "camera stops", "silence, frame age", silent),
        _abort("camera-stops-for-good", "camera stops for good", "3 s in HOLD", silent, 3600.0),
        _hold(
            *("camera-freezes", "camera freezes", "same pixels ×3"),
            _after_first(lambda first, now: now.showing(first.image).packet()),
        ),
        _hold(
            *("frames-repeat", "one sample again and again", "capture time"),
            _after_first(lambda first, _: first.packet()),
        ),
        _hold(
            *("stamps-old", "stamps a second old", "capture age"),
            _sends(lambda s, _: [replace(s, t_ns=s.t_ns - 1000 * MS).packet()]),
        ),
        _hold(
            *("stamps-future", "stamps 0.1 s ahead", "clock skew"),
            _sends(lambda s, _: [replace(s, t_ns=s.t_ns + 100 * MS).packet()]),
        ),
        _hold("stamps-reordered", "frames out of order", "capture time", _films(_swapped_order)),
        _hold(
            *("other-clock", "stamped by another machine", "clock identity"),
            _sends(lambda s, rng: [replace(s, clock=rng.bytes(16)).packet()]),
        ),
        _hold("wrong-size", "wrong size", "calibration", _sends(_other_size)),
        _hold(
            "wrong-format", "pixels are not what the header says", "decoder", _sends(_other_format)
        ),
        _hold(
            *("wrong-colours", "red and blue exchanged", "colours of corresponding points"),
            _shows(lambda i: i[:, :, ::-1]),
        ),
        _hold("black", "black image", "brightness", _shows(lambda i: i // 64)),
        _hold("saturated", "white image", "brightness", _shows(lambda i: i // 64 + 251)),
        _hold("no-contrast", "grey image", "contrast", _shows(lambda i: i // 128 + 120)),
        _hold("corrupt-jpeg", "flipped bits in a JPEG", "checksum", _sends(_damaged)),
        _hold("truncated-jpeg", "JPEG cut short", "checksum", _sends(_cut)),
        _hold("image-bomb", "36 megapixels in a PNG of 100 kB", "header", _films(_bombs)),
        _hold("hostile-frames", "400 rubbish samples a second", "header, checksum", _sends(_flood)),
        _hold("no-texture", "stripes", "conditioning, agreement", _shows(_stripes)),
        _hold("goal-lost", "view shares nothing with the goal", "overlap", _shows(unrelated_view)),
        _hold("network-nan", "network gives NaN", "finite", _misbehaves(Misbehaviour.NAN), Setup()),
        _hold(
            *("network-garbage", "network gives garbage", "forward–backward, inliers"),
            _misbehaves(Misbehaviour.GARBAGE),
            Setup(),
        ),
        _hold(
            *("network-unsure", "flow there and back disagree", "confidence"),
            _misbehaves(Misbehaviour.ONE_WAY),
            Setup(),
        ),
        _hold(
            *("network-slow", "network takes over 0.2 s", "result's age"),
            _misbehaves(Misbehaviour.SLOW),
            Setup(),
        ),
        dead_network,
    )
