"""When the mock camera's pictures are of, and when they are published."""

import contextlib
import threading
import time
from types import SimpleNamespace

import numpy as np
import pytest
import zenoh

from dfvs_core.geometry.camera import CameraModel
from dfvs_core.messages.frame import PixelFormat, decode_header
from dfvs_sim.camera.mock import MockCamera, MockCameraConfig

pytestmark = pytest.mark.real_time
CAMERA = CameraModel.from_horizontal_fov(32, 24, 1.3)
RENDER_S = 0.04
FRAMES = 40


class SlowRenderer:
    """Renders grey; takes its time for so many pictures."""

    def __init__(self, slow=FRAMES):
        self.slow = slow

    def render(self, camera, _pose):
        self.slow -= 1
        time.sleep(RENDER_S if self.slow >= 0 else 0.0)
        return SimpleNamespace(image=np.full((camera.height, camera.width, 3), 90, np.uint8))


def test_a_picture_shows_the_moment_at_which_it_is_ready():
    ages_ns, asked_ns, stop = [], [], threading.Event()

    def pose(t_ns):
        asked_ns.append(t_ns)
        return np.eye(4)

    def publish(_payload, attachment, _encoding):
        header = decode_header(attachment)
        assert header.t_capture_ns == asked_ns[-1]
        ages_ns.append(time.monotonic_ns() - header.t_capture_ns)
        if len(ages_ns) == FRAMES:
            stop.set()

    config = MockCameraConfig(CAMERA, rate_hz=100.0, pixel_format=PixelFormat.RGB8)
    MockCamera(config, SlowRenderer(), pose, publish).run(stop)
    assert min(ages_ns) >= 0  # never stamped in the future
    assert ages_ns[0] >= RENDER_S * 1e9
    assert np.median(ages_ns[FRAMES // 2 :]) < 0.5 * RENDER_S * 1e9


def test_the_camera_is_quick_again_when_the_machine_is():
    """The wait for a picture's moment is not taken for the time to render it."""
    leads_ns, stop = [], threading.Event()

    def pose(t_ns):
        leads_ns.append(t_ns - time.monotonic_ns())
        if len(leads_ns) == FRAMES:
            stop.set()
        return np.eye(4)

    config = MockCameraConfig(CAMERA, rate_hz=100.0, pixel_format=PixelFormat.RGB8)
    renderer = SlowRenderer(slow=FRAMES // 4)
    MockCamera(config, renderer, pose, lambda *_: None).run(stop)
    assert max(leads_ns) > 0.4 * RENDER_S * 1e9
    assert np.median(leads_ns[-5:]) < 0.2 * RENDER_S * 1e9


@pytest.mark.parametrize("is_told_to_end", [True, False])
def test_a_session_that_is_closed_matters_only_while_the_camera_runs(is_told_to_end):
    stop = threading.Event()

    def publish(*_):
        if is_told_to_end:
            stop.set()
        raise zenoh.ZError("session closed")

    config = MockCameraConfig(CAMERA, rate_hz=100.0, pixel_format=PixelFormat.RGB8)
    camera = MockCamera(config, SlowRenderer(slow=0), lambda _: np.eye(4), publish)
    expected = contextlib.nullcontext() if is_told_to_end else pytest.raises(zenoh.ZError)
    with expected:
        camera.run(stop)
    assert camera.frames == 0
