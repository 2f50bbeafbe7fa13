import numpy as np
import pytest

from dfvs_core.geometry.camera import CameraModel
from dfvs_core.messages.frame import Frame, FrameHeader, PixelFormat, encode_frame, encode_header
from dfvs_core.perception.frame_validator import (
    Expected,
    FrameFault,
    GuardState,
    admit,
    check_content,
    check_header,
)

CAMERA = CameraModel.from_horizontal_fov(320, 240, 1.3)
MS = 1_000_000
NOW = 10_000 * MS
CLOCK = b"c" * 16
EXPECTED = Expected(CAMERA, CLOCK)


def header(t_ms=9_990, checksum=1, size=(320, 240), clock=CLOCK, seq=1):
    return FrameHeader(*size, PixelFormat.JPEG, seq, t_ms * MS, checksum, clock)


def judge(frame_header, state=None):
    return check_header(state or GuardState(), frame_header, EXPECTED, NOW)


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


@pytest.mark.parametrize(("gap_ms", "fault"), [(150, None), (151, FrameFault.FROZEN)])
def test_a_slow_camera_is_frozen_by_the_time_that_one_picture_is_shown(gap_ms, fault):
    _, state = judge(header(t_ms=9_990 - gap_ms, checksum=7))
    assert judge(header(t_ms=9_990, checksum=7), state)[0] is fault
    assert judge(header(t_ms=9_990, checksum=8), state)[0] is None


@pytest.mark.parametrize(
    ("seqs", "refused"),
    [
        pytest.param([1, 2, 3, 4], [], id="one camera"),
        pytest.param([1, 2, 5, 9], [], id="lost frames"),
        pytest.param([0, 0, 0, 0], [], id="a camera that does not count"),
        pytest.param([70, 71, 0, 1], [2], id="a restart"),
        pytest.param([3, 700, 4, 701, 5, 702], [2, 4], id="two cameras"),
    ],
)
def test_frames_of_two_cameras_are_told_by_their_sequence_numbers(seqs, refused):
    state, faults = GuardState(), {}
    for i, seq in enumerate(seqs):
        fault, state = judge(header(t_ms=9_900 + 10 * i, checksum=i, seq=seq), state)
        faults[i] = fault
    assert {i: fault for i, fault in faults.items() if fault} == dict.fromkeys(
        refused, FrameFault.OTHER_CAMERA
    )


def test_a_refused_frame_changes_nothing():
    state = GuardState(5, 6, 1)
    assert judge(header(t_ms=9_000), state)[1] == state


def test_pictures_are_judged_by_their_brightness(rng):
    def flat(level):
        return np.full((240, 320, 3), level, np.uint8)

    assert check_content(flat(0)) is FrameFault.DARK
    assert check_content(flat(255)) is FrameFault.BRIGHT
    assert check_content(flat(100)) is FrameFault.FLAT
    assert check_content(rng.integers(60, 180, (240, 320, 3)).astype(np.uint8)) is None


def sent(rng, t_ms=9_990, damage=lambda payload, attachment: (payload, attachment), level=None):
    image = rng.integers(0, 255, (240, 320, 3)).astype(np.uint8)
    image = image if level is None else np.full_like(image, level)
    message = damage(*encode_frame(Frame(image, t_ms * MS, 7), PixelFormat.PNG, CLOCK))
    return image, admit(GuardState(), *message, EXPECTED, NOW)


def test_a_good_frame_is_admitted_and_remembered(rng):
    image, came = sent(rng)
    np.testing.assert_array_equal(came.frame.image, image)
    assert (came.seq, came.t_capture_ns, came.reason) == (7, 9_990 * MS, "")
    assert came.state.t_capture_ns == 9_990 * MS


@pytest.mark.parametrize(
    ("damage", "words"),
    [
        (lambda payload, attachment: (payload, b""), "attachment of 0 bytes"),
        (lambda payload, attachment: (payload[:-1], attachment), "checksum"),
    ],
)
def test_a_frame_that_cannot_be_read_is_refused_and_forgotten(rng, damage, words):
    """Else a broken frame with a later stamp would keep good ones out."""
    _, came = sent(rng, damage=damage)
    assert came.frame is None
    assert words in came.reason
    assert came.state == GuardState()


def test_a_frame_refused_for_its_header_or_brightness_says_which_one_it_was(rng):
    for _, came in (sent(rng, t_ms=9_000), sent(rng, level=0)):
        assert came.frame is None
        assert came.seq == 7
        assert came.reason


def test_a_frame_of_another_size_or_age_is_refused_with_what_was_found_and_expected():
    for frame_header, words in (
        (header(size=(640, 480)), "(640 x 480 px; expected 320 x 240)"),
        (header(t_ms=0), "(10.00 s; expected at most 0.25)"),
    ):
        assert words in admit(GuardState(), b"", encode_header(frame_header), EXPECTED, NOW).reason
