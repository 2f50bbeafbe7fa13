"""Frames that are too large for a message."""

import queue
import time
from types import SimpleNamespace

import numpy as np
import pytest
from loopback import listening_peer, peer

from dfvs_core.errors import ImageError
from dfvs_core.geometry.camera import CameraModel
from dfvs_core.messages.frame import PixelFormat
from dfvs_core.messages.topics import Topics
from dfvs_service.camera.publisher import FramePublisher, PublishOptions
from dfvs_service.frames import CapturedImage
from dfvs_sim.camera.mock import MockCamera, MockCameraConfig

LARGE = np.zeros((1536, 2048, 3), np.uint8)
"""9.4 MB of pixels; a message has at most 8 MiB."""


def test_a_camera_refuses_a_frame_that_nobody_would_receive():
    with listening_peer() as (session, _):
        raw = FramePublisher(session, PublishOptions("drone1", PixelFormat.RGB8))
        with pytest.raises(ImageError, match=r"9\.4 MB.*--format jpeg"):
            raw.publish(CapturedImage(LARGE, time.monotonic_ns()))
        assert raw.count == 0
        jpeg = FramePublisher(session, PublishOptions("drone1", PixelFormat.JPEG))
        jpeg.publish(CapturedImage(LARGE, time.monotonic_ns()))
        assert jpeg.count == 1


def test_a_frame_just_below_the_limit_is_received():
    name = "a" * 32
    largest = np.zeros((2047, 4096, 3), np.uint8)  # 4 kB below 8 MiB in grey levels
    received = queue.Queue()
    with listening_peer() as (service, endpoint), peer(connect=(endpoint,)) as camera:
        subscriber = service.declare_subscriber(Topics(name).camera, received.put)
        publisher = FramePublisher(camera, PublishOptions(name, PixelFormat.MONO8))
        deadline_s = time.monotonic() + 30.0
        while received.empty() and time.monotonic() < deadline_s:
            publisher.publish(CapturedImage(largest, time.monotonic_ns()))
            time.sleep(0.05)
        assert len(received.get_nowait().payload.to_bytes()) == 2047 * 4096
        subscriber.undeclare()


def test_the_mock_camera_refuses_a_frame_that_nobody_would_receive():
    camera = CameraModel.from_horizontal_fov(2048, 1536, 1.3)
    config = MockCameraConfig(camera, pixel_format=PixelFormat.RGB8, noise=0.0)
    renderer = SimpleNamespace(render=lambda *_: SimpleNamespace(image=LARGE))
    mock = MockCamera(config, renderer, lambda _: np.eye(4), lambda *_: None)
    with pytest.raises(ImageError, match=r"9\.4 MB.*--format jpeg"):
        mock.capture(time.monotonic_ns())
    assert mock.frames == 0
