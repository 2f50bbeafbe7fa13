from itertools import pairwise

import numpy as np
import pytest

from dfvs_core.messages.frame import Frame, PixelFormat, encode_frame
from dfvs_service.perception.frame_rate_limiter import FrameRateLimiter

S = 1_000_000_000


def attachment(width=64, height=48):
    frame = Frame(np.zeros((height, width, 3), np.uint8), 1, 1)
    return encode_frame(frame, PixelFormat.RGB8)[1]


def test_good_frames_pass_however_many_they_are():
    door = FrameRateLimiter((64, 48), 0.2, 0)
    assert all(door.admits(attachment(), 0) for _ in range(1000))
    assert door.turned_away == 0


@pytest.mark.parametrize(
    "bad", [b"", b"x" * 48, attachment(48, 64)], ids=["none", "rubbish", "size"]
)
def test_of_bad_frames_ten_a_second_pass_to_be_named(bad):
    door = FrameRateLimiter((64, 48), 0.2, 0)
    passed = sum(door.admits(bad, i * S // 1000) for i in range(4000))
    assert 49 <= passed <= 50  # 10 at once at first, and those of 4 s
    assert door.turned_away == 4000 - passed
    assert door.admits(attachment(), 4 * S)


@pytest.mark.parametrize("silence_s", [0.2, 2 / 60])
def test_between_bad_frames_that_pass_the_camera_never_counts_as_silent(silence_s):
    door = FrameRateLimiter((64, 48), silence_s, 0)
    passed = [t_ms for t_ms in range(0, 10_000, 16) if door.admits(b"", t_ms * S // 1000)]
    assert max(after - t_ms for t_ms, after in pairwise(passed)) < silence_s * 1000
