import numpy as np
import pytest

from dfvs_core.camera import CameraModel
from dfvs_core.frame_guard import FrameFault, GuardState, check_header, check_picture
from dfvs_core.wire.frame import FrameHeader, PixelFormat

CAMERA = CameraModel.from_horizontal_fov(320, 240, 1.3)
MS = 1_000_000
NOW = 10_000 * MS
CLOCK = b"c" * 16


def header(t_ms=9_990, checksum=1, size=(320, 240), clock=CLOCK):
    return FrameHeader(*size, PixelFormat.JPEG, 1, t_ms * MS, checksum, clock)


def judge(frame_header, state=None):
    return check_header(state or GuardState(), frame_header, CAMERA, NOW, CLOCK)


@pytest.mark.parametrize(
    ("frame_header", "fault"),
    [
        (header(), None),
        (header(clock=bytes(16)), None),
        (header(size=(640, 480)), FrameFault.WRONG_SIZE),
        (header(t_ms=9_700), FrameFault.STALE),
        (header(t_ms=10_100), FrameFault.FUTURE),
        (header(clock=b"d" * 16), FrameFault.OTHER_CLOCK),
    ],
)
def test_frames_are_judged_by_their_header(frame_header, fault):
    assert judge(frame_header)[0] is fault


@pytest.mark.parametrize("t_ms", [9_990, 9_985])
def test_a_frame_must_be_newer_than_the_last(t_ms):
    _, state = judge(header(t_ms=9_990))
    assert judge(header(t_ms=t_ms, checksum=2), state)[0] is FrameFault.REORDERED


def test_the_third_equal_picture_counts_as_frozen():
    state, faults = GuardState(), []
    for t_ms in (9_900, 9_930, 9_960, 9_990):
        fault, state = judge(header(t_ms=t_ms, checksum=7), state)
        faults.append(fault)
    assert faults == [None, None, FrameFault.FROZEN, FrameFault.FROZEN]
    assert judge(header(t_ms=9_995, checksum=8), state)[0] is None


def test_a_refused_frame_changes_nothing():
    state = GuardState(5, 6, 1)
    assert judge(header(t_ms=9_000), state)[1] == state


def test_pictures_are_judged_by_their_brightness(rng):
    def flat(level):
        return np.full((240, 320, 3), level, np.uint8)

    assert check_picture(flat(0)) is FrameFault.DARK
    assert check_picture(flat(255)) is FrameFault.BRIGHT
    assert check_picture(flat(100)) is FrameFault.FLAT
    assert check_picture(rng.integers(60, 180, (240, 320, 3)).astype(np.uint8)) is None
