import numpy as np
import pytest

from dfvs_core.messages.frame import Frame, PixelFormat, encode_frame
from dfvs_service.perception.frame_rate_limiter import BAD_FRAME_RATE, FrameRateLimiter

S = 1_000_000_000


def attachment(width=64, height=48):
    frame = Frame(np.zeros((height, width, 3), np.uint8), 1, 1)
    return encode_frame(frame, PixelFormat.RGB8)[1]


def test_good_frames_pass_however_many_they_are():
    door = FrameRateLimiter((64, 48), 0)
    assert all(door.admits(attachment(), 0) for _ in range(1000))
    assert door.turned_away == 0


@pytest.mark.parametrize(
    "bad", [b"", b"x" * 48, attachment(48, 64)], ids=["none", "rubbish", "size"]
)
def test_of_bad_frames_a_few_a_second_pass_to_be_named(bad):
    door = FrameRateLimiter((64, 48), 0)
    passed = sum(door.admits(bad, i * S // 1000) for i in range(4000))
    most = BAD_FRAME_RATE.burst + 4 * BAD_FRAME_RATE.per_s
    assert most - 1 <= passed <= most
    assert door.turned_away == 4000 - passed
    assert door.admits(attachment(), 4 * S)
