"""What the scripted camera sends while a fault lasts."""

import numpy as np
import pytest

from dfvs_core.geometry.camera import CameraModel
from dfvs_core.messages.frame import PixelFormat
from dfvs_core.perception.frame_validator import Expected, GuardState, admit
from dfvs_robustness.faults.table import all_faults
from dfvs_robustness.harness.camera import PERIOD_NS, CapturedFrame, ScriptedCamera

CAMERA = CameraModel.from_horizontal_fov(160, 120, 1.3)
CLOCK = b"c" * 16
T0 = 10**12


class Wall:
    def capture(self, pose):
        return np.full((120, 160, 3), 128, np.uint8)


class Harness:
    def __init__(self):
        self.camera = ScriptedCamera(Wall(), PixelFormat.RGB8, lambda payload, attachment: None)


def reasons(fault, rng):
    """Why each sample of a fault's first 12 frames is refused, empty where it is not."""
    harness = Harness()
    all_faults()[fault].inject(harness, rng)
    told, guard = [], GuardState()
    for i in range(12):
        image = rng.integers(0, 255, (120, 160, 3)).astype(np.uint8)
        t_ns = T0 + i * PERIOD_NS
        for payload, attachment in harness.camera.script(
            CapturedFrame(image, t_ns, i, PixelFormat.RGB8, CLOCK)
        ):
            came = admit(guard, payload, attachment, Expected(CAMERA, CLOCK), t_ns + 1_000_000)
            guard = came.state
            told.append(came.reason)
    return told


def test_frames_out_of_order_are_refused(rng):
    told = reasons("stamps-reordered", rng)
    refused = "the frame is not newer than the one before"
    assert told == ["", refused, ""] + [refused, refused, ""] * 3


def test_a_frozen_camera_is_refused_from_the_third_picture_on(rng):
    told = reasons("camera-freezes", rng)
    assert told[:2] == ["", ""]
    assert set(told[2:]) == {"the camera repeats the same image"}


@pytest.mark.parametrize(("fault", "good"), [("camera-freezes", 1), ("stamps-reordered", 0)])
def test_the_first_picture_of_a_frozen_camera_alone_is_of_its_time(fault, good, rng):
    camera = (harness := Harness()).camera
    camera.capture(None, T0)
    all_faults()[fault].inject(harness, rng)
    for i in range(1, 4):
        camera.capture(None, T0 + i * PERIOD_NS)
    assert camera.last_good_ns == T0 + good * PERIOD_NS


def test_a_camera_that_stops_sends_nothing(rng):
    assert reasons("camera-stops", rng) == []
