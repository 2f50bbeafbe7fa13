"""When the mock camera's pictures are of, and when they are published."""

import threading
import time
from types import SimpleNamespace

import numpy as np

from dfvs_core.camera import CameraModel
from dfvs_core.wire.frame import PixelFormat, decode_header
from dfvs_sim.camera.mock import MockCamera, MockCameraConfig

CAMERA = CameraModel.from_horizontal_fov(32, 24, 1.3)
RENDER_S = 0.04
FRAMES = 40


class SlowRenderer:
    """Renders grey; takes its time."""

    def render(self, camera, _pose):
        time.sleep(RENDER_S)
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
