"""Frame validation: age, order, size, frozen and featureless images.

``admit`` takes a frame from the network through all of it, from bytes to pixels.
"""

import enum
from dataclasses import dataclass

import numpy as np

from dfvs_core.errors import DfvsError
from dfvs_core.geometry.arrays import ImageArray
from dfvs_core.geometry.camera import CameraModel
from dfvs_core.messages.frame import Frame, FrameHeader, decode_frame, decode_header

MAX_AGE_NS = 250_000_000
MAX_AHEAD_NS = 20_000_000
FROZEN_FRAMES = 3
FROZEN_NS = 150_000_000
"""An image that is shown for longer than this is frozen, at however few frames a second."""

_DARK, _BRIGHT, _FLAT = 6.0, 249.0, 2.0


class FrameFault(enum.Enum):
    """Why a frame is not used."""

    WRONG_SIZE = "the frame's size is not the camera's"
    STALE = "the frame was old when it arrived"
    FUTURE = "the frame carries a time that is still to come"
    REORDERED = "the frame is not newer than the one before"
    FROZEN = "the camera repeats the same image"
    OTHER_CAMERA = (
        "the frame's sequence number went back: another camera publishes too, or it was restarted"
    )
    OTHER_CLOCK = "the frame was stamped by another machine's clock"
    DARK = "the image is black"
    BRIGHT = "the image is white"
    FLAT = "the image has no contrast"


@dataclass(frozen=True, slots=True)
class GuardState:
    """What is remembered of the last frame whose time was right.

    ``shown_ns`` is the capture of the first frame with these very pixels.
    """

    t_capture_ns: int = -1
    checksum: int = -1
    repeats: int = 0
    shown_ns: int = -1
    seq: int = 0


@dataclass(frozen=True, slots=True)
class Expected:
    """What every frame must fit: the camera's size, and the identity of our own clock."""

    camera: CameraModel
    clock: bytes


@dataclass(frozen=True, slots=True)
class Admission:
    """What became of a frame's bytes: the frame, or the reason why there is none.

    ``seq`` and ``t_capture_ns`` are 0 where not even the header could be read; ``state`` is the
    memory for the next frame.
    """

    state: GuardState
    frame: Frame | None = None
    reason: str = ""
    seq: int = 0
    t_capture_ns: int = 0


def admit(
    state: GuardState, payload: bytes, attachment: bytes, expected: Expected, now_ns: int
) -> Admission:
    """Judge a frame and decode it; nothing is decoded before its header was found right.

    Parameters
    ----------
    state : GuardState
        Memory from the frame before.
    payload, attachment : bytes
        The frame as it came from the network: whoever sent it, it does no harm.
    expected : Expected
        What it must fit.
    now_ns : int
        Monotonic time.
    """
    try:
        header = decode_header(attachment)
        fault, after = check_header(state, header, expected, now_ns)
        if fault is not None:
            reason = _reason(fault, header, expected, now_ns)
            return Admission(after, None, reason, header.seq, header.t_capture_ns)
        frame = decode_frame(payload, header)
    except DfvsError as error:
        return Admission(state, None, f"the frame cannot be read: {error}")
    fault = check_content(frame.image)
    if fault is not None:
        return Admission(after, None, fault.value, frame.seq, frame.t_capture_ns)
    return Admission(after, frame, "", frame.seq, frame.t_capture_ns)


def _reason(fault: FrameFault, header: FrameHeader, expected: Expected, now_ns: int) -> str:
    """Fault, with what was found and expected where the header alone tells it."""
    if fault is FrameFault.WRONG_SIZE:
        size = "{} x {}".format(*expected.camera.size)
        return f"{fault.value} ({header.width} x {header.height} px; expected {size})"
    if fault is FrameFault.STALE:
        age_s = (now_ns - header.t_capture_ns) / 1e9
        return f"{fault.value} ({age_s:.2f} s; expected at most {MAX_AGE_NS / 1e9:g})"
    return str(fault.value)


def check_header(
    state: GuardState, header: FrameHeader, expected: Expected, now_ns: int
) -> tuple[FrameFault | None, GuardState]:
    """Judge a frame by its header, before its pixels are touched; see :func:`admit`."""
    if (header.width, header.height) != expected.camera.size:
        return FrameFault.WRONG_SIZE, state
    if any(header.clock) and header.clock != expected.clock:  # it cannot be dated
        return FrameFault.OTHER_CLOCK, state
    if now_ns - header.t_capture_ns > MAX_AGE_NS:
        return FrameFault.STALE, state
    if header.t_capture_ns - now_ns > MAX_AHEAD_NS:
        return FrameFault.FUTURE, state
    if header.t_capture_ns <= state.t_capture_ns:
        return FrameFault.REORDERED, state
    t_ns, is_same = header.t_capture_ns, header.checksum == state.checksum
    repeats, shown_ns = (state.repeats + 1, state.shown_ns) if is_same else (0, t_ns)
    is_frozen = repeats + 1 >= FROZEN_FRAMES or t_ns - shown_ns > FROZEN_NS
    after = GuardState(t_ns, header.checksum, repeats, shown_ns, header.seq)
    if header.seq < state.seq:  # equal ones: a camera that does not count
        return FrameFault.OTHER_CAMERA, after
    return (FrameFault.FROZEN if is_frozen else None), after


def check_content(image: ImageArray) -> FrameFault | None:
    """Judge the brightness of an image (H, W, 3) by every eighth pixel."""
    sample = image[::8, ::8].astype(np.float32)
    mean, deviation = float(sample.mean()), float(sample.std())
    if mean < _DARK:
        return FrameFault.DARK
    if mean > _BRIGHT:
        return FrameFault.BRIGHT
    return FrameFault.FLAT if deviation < _FLAT else None
