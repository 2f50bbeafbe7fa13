"""Live sources that are lost and found again; recordings at their own pace."""

import threading
import time

import numpy as np
import pytest
from waiting import until

from dfvs_service.camera.feed import LiveFeed, RecordedFeed
from dfvs_service.camera.publisher import RateReport
from dfvs_service.camera.sources.spec import CameraError, SourceLostError
from dfvs_service.frames import CapturedImage


class Script:
    """A source that plays what it is told: pictures, losses, errors, the end."""

    rate_hz = 200.0

    def __init__(self, *items):
        self._items = list(items)
        self.closed = 0

    def read(self):
        item = self._items.pop(0) if self._items else None
        if isinstance(item, Exception):
            raise item
        return None if item is None else CapturedImage(np.full((4, 4, 3), item, np.uint8), item)

    def close(self):
        self.closed += 1


class Openings:
    """Gives one script after the other; an error among them is raised on opening."""

    def __init__(self, *scripts):
        self._scripts = list(scripts)

    def __call__(self):
        script = self._scripts.pop(0) if self._scripts else SourceLostError("gone for good")
        if isinstance(script, Exception):
            raise script
        return script


def test_a_lost_camera_is_said_once_and_opened_again():
    lines, back = [], threading.Event()

    def say(line):
        lines.append(line)
        if "back" in line:
            back.set()

    absent = [SourceLostError("there is no camera /dev/video0")] * 3
    first = Script(1, SourceLostError("it gives no more pictures"))
    feed = LiveFeed(Openings(first, *absent, Script(2, 3)), say, retry_s=0.01)
    assert back.wait(30.0)
    feed.close()
    assert first.closed == 1
    assert [line.split(";")[0] for line in lines[:3]] == [
        "it gives no more pictures",
        "there is no camera /dev/video0",
        "the source is back",
    ]
    assert "trying again" in lines[0]


def test_only_the_newest_picture_is_kept():
    feed = LiveFeed(Openings(Script(1, 2, 3)), lambda _line: None, retry_s=60.0)
    assert until(lambda: feed._mailbox.dropped == 2, 5.0, 0.001)
    assert feed.receive(1.0).t_capture_ns == 3
    assert feed.receive(0.0) is None
    feed.close()


def test_what_cannot_be_mended_by_trying_again_ends_it():
    feed = LiveFeed(Openings(CameraError("no GStreamer")), lambda _line: None)
    with pytest.raises(CameraError, match="no GStreamer"):
        feed.receive(5.0)
    feed.close()


@pytest.mark.filterwarnings("ignore::pytest.PytestUnhandledThreadExceptionWarning")
def test_a_library_s_own_error_ends_it_too():
    feed = LiveFeed(Openings(Script(1, RuntimeError("a driver's"))), lambda _line: None)
    with pytest.raises(CameraError, match="ended by itself"):
        taken(feed, 2)
    feed.close()


def taken(feed, count):
    shots = []
    deadline = time.monotonic() + 5.0
    while len(shots) < count and not feed.ended and time.monotonic() < deadline:
        shot = feed.receive(0.1)
        if shot is not None:
            shots.append(shot)
    return shots


def test_a_recording_ends_and_its_pictures_are_stamped_anew():
    before_ns = time.monotonic_ns()
    feed = RecordedFeed(Openings(Script(1, 2)), 10.0, loop=False)
    shots = taken(feed, 9)
    feed.close()
    assert [int(s.image[0, 0, 0]) for s in shots] == [1, 2]
    assert feed.ended
    assert before_ns < shots[0].t_capture_ns
    # The pace asked for is kept: 100 ms, and nothing is ever due earlier.
    assert shots[1].t_capture_ns - shots[0].t_capture_ns > 50_000_000


def test_a_recording_in_a_loop_begins_again():
    feed = RecordedFeed(Openings(Script(1, 2), Script(1, 2)), None, loop=True)
    assert [int(s.image[0, 0, 0]) for s in taken(feed, 3)] == [1, 2, 1]
    feed.close()


def test_silence_is_said_once_and_rates_every_five_seconds():
    lines = []
    report = RateReport(lines.append, next_s=5.0, last_frame_s=0.0)
    for i in range(50):
        report.frame(0.1 * i, 2000)
    for t in (4.9, 5.0, 6.0, 8.0, 9.0):
        report.update(t)
    assert lines == ["10.0 frames a second, 2 kB each", "no image for 3.1 s"]
