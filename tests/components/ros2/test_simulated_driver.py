"""The simulated ROS 2 driver and the service's intake, over a real Zenoh session."""

import queue
import time

import numpy as np
import pytest
import zenoh
from loopback import listening_peer, peer

from dfvs_core.geometry.camera import CameraModel
from dfvs_core.messages.frame import Frame, PixelFormat, decode_frame, decode_header, encode_frame
from dfvs_core.messages.zenoh_settings import zenoh_settings
from dfvs_service.frames import RawSample
from dfvs_service.ros2.frame_source import Ros2FrameSource
from dfvs_service.settings.camera_section import Ros2CameraSection
from dfvs_service.zenoh_session import publisher_of
from dfvs_sim.camera.ros2 import Ros2Camera, Ros2CameraConfig

CAMERA = CameraModel(64, 48, 50.0, 51.0, 32.5, 24.0, (0.1, -0.2, 0.01, 0.02, 0.0))
CLOCK = b"c" * 16
FORMATS = [PixelFormat.RGB8, PixelFormat.MONO8, PixelFormat.PNG, PixelFormat.JPEG]


def test_two_bridges_on_one_topic_are_told_apart():
    samples = queue.Queue()
    with listening_peer() as (service, place):
        subscriber = service.declare_subscriber("nose/camera/image_raw", samples.put)
        for _ in range(2):
            settings = zenoh.Config()
            for key, value in zenoh_settings("peer", (place,), ()):
                settings.insert_json5(key, value)
            settings.insert_json5("timestamping/enabled", "true")  # as each bridge has it
            with zenoh.open(settings) as bridge:
                publisher = bridge.declare_publisher("nose/camera/image_raw")
                while not publisher.matching_status.matching:
                    time.sleep(0.01)
                for _ in range(2):
                    publisher.put(b"an image")
        first, same, *others = [publisher_of(samples.get(timeout=30.0)) for _ in range(4)]
        del subscriber
    assert first == same != ""
    assert first not in others


@pytest.fixture
def sessions():
    """Service's side, and the driver's."""
    with listening_peer() as (service, place), peer(connect=(place,)) as driver:
        yield service, driver


@pytest.mark.parametrize("link", ["rmw", "bridge"])
@pytest.mark.parametrize("pixel_format", FORMATS)
def test_what_the_driver_sends_is_the_frame_that_was_taken(sessions, rng, link, pixel_format):
    service, driver = sessions
    config = Ros2CameraConfig(link, CAMERA, pixel_format, "nose/camera", domain=7)
    publisher = Ros2Camera(driver, config)
    compressed = pixel_format in (PixelFormat.PNG, PixelFormat.JPEG)
    section = Ros2CameraSection(config.image.name, compressed, domain=7)
    intake = Ros2FrameSource(link, section, CLOCK)
    frames, infos = queue.Queue(), queue.Queue()
    subscribers = [
        service.declare_subscriber(intake.key, frames.put),
        service.declare_subscriber(intake.calibration_key, infos.put),
    ]
    image = np.repeat(rng.integers(0, 255, (48, 64, 1)), 3, axis=2).astype(np.uint8)
    first_ns = taken_ns = time.monotonic_ns()
    deadline = time.monotonic() + 30.0
    while (frames.empty() or infos.empty()) and time.monotonic() < deadline:
        taken_ns = time.monotonic_ns()
        publisher.publish(*encode_frame(Frame(image, taken_ns, 41), pixel_format, CLOCK), "")
        time.sleep(0.05)
    sample = frames.get_nowait()
    attachment = b"" if sample.attachment is None else sample.attachment.to_bytes()
    raw = RawSample(sample.payload.to_bytes(), attachment, time.monotonic_ns())
    translated = intake.translate(raw)
    frame = decode_frame(translated.payload, decode_header(translated.attachment))
    if pixel_format is PixelFormat.JPEG:
        assert np.abs(frame.image.astype(int) - image).mean() < 12
    else:
        np.testing.assert_array_equal(frame.image, image)
    # It went to wall-clock time and back; two clocks are read for it.
    assert first_ns - 100_000_000 < frame.t_capture_ns < taken_ns + 100_000_000
    assert frame.seq == (41 if link == "rmw" else 1)
    camera = intake.camera(infos.get_nowait().payload.to_bytes())
    assert camera == CAMERA
    del subscribers
