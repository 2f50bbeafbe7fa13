"""Rate and size of the live camera."""

import numpy as np
import pytest

from dfvs_core.messages.frame import Frame, PixelFormat, encode_frame
from dfvs_service.frames import RawSample
from dfvs_service.preflight.stream import Stream, judge, listen

MS = 1_000_000
FRAME = Frame(np.zeros((48, 64, 3), np.uint8), 1, 1)
_, ATTACHMENT = encode_frame(FRAME, PixelFormat.PNG, bytes(16))


class Camera:
    """Sends a frame each interval after a start, on a clock that waiting moves."""

    def __init__(self, first_ms, interval_ms, attachment=ATTACHMENT):
        self.now_ns, self.next_ns = 0, first_ms * MS
        self.interval_ns, self.attachment = interval_ms * MS, attachment

    def tick(self):
        return self.now_ns

    def take(self):
        if self.next_ns > self.now_ns + 50 * MS:
            self.now_ns += 50 * MS
            return None
        self.now_ns = max(self.now_ns, self.next_ns)
        self.next_ns += self.interval_ns
        return RawSample(b"", self.attachment, self.now_ns)


@pytest.mark.parametrize(("first_ms", "interval_ms", "rate_hz"), [(0, 50, 20.0), (3900, 125, 8.0)])
def test_a_second_from_the_first_frame_on_gives_the_rate(first_ms, interval_ms, rate_hz):
    camera = Camera(first_ms, interval_ms)
    stream = listen(camera.take, camera.tick)
    assert stream.size == (64, 48)
    assert stream.rate_hz == pytest.approx(rate_hz)
    assert camera.now_ns <= (first_ms + 1000 + interval_ms) * MS


def test_a_single_frame_has_no_rate():
    camera = Camera(0, 2000)
    assert listen(camera.take, camera.tick) == Stream((64, 48), 0.0)


@pytest.mark.parametrize("camera", [Camera(9000, 50), Camera(0, 50, b"no header")])
def test_silence_and_noise_are_no_stream(camera):
    assert listen(camera.take, camera.tick) is None
    assert 4000 * MS <= camera.now_ns < 4100 * MS


@pytest.mark.parametrize(
    ("stream", "ok", "pending", "words"),
    [
        (Stream((64, 48), 8.0), True, False, "64 x 48 px, 8.0 frames a second, 8 needed"),
        (Stream((64, 48), 7.9), False, False, "7.9 frames a second; 8 needed"),
        (Stream((48, 64), 30.0), False, False, "48 x 64 px, 30.0 frames a second; 64 x 48 px"),
        (None, True, True, "no frame within 4 s"),
    ],
)
def test_size_and_rate_are_judged_and_silence_is_not(stream, ok, pending, words):
    check = judge(stream, (64, 48), 8.0)
    assert (check.ok, check.pending, bool(check.remedy)) == (ok, pending, not ok)
    assert words in check.detail
