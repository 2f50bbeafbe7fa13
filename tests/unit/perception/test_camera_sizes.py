"""Perception of cameras of any size: working size, velocity, and memory."""

import tracemalloc

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from still_pipeline import pipeline
from textured_wall import Wall, texture

from dfvs_core.depth.depth_map import DepthMap
from dfvs_core.matching.config import MatchingConfig
from dfvs_core.messages.frame import Frame
from dfvs_core.perception.keyframes import MOST_KEYFRAMES
from dfvs_core.perception.vehicle_history import Motion

MS = 1_000_000
RIGHT_M_S = 0.129
"""Velocity of a level body whose camera of 320 px sees the goal 6 px too far to the right."""


def enlarged(picture, width):
    return np.kron(picture, np.ones((width // 320, width // 320, 1), np.uint8))


@pytest.mark.parametrize("source", ["constant", "given"])
@pytest.mark.parametrize("width", [320, 640, 1280])
def test_a_camera_of_any_size_is_asked_for_the_same_velocity(source, width):
    wall = Wall(texture(np.random.default_rng(3))).picture()
    goal, view = enlarged(wall, width), enlarged(np.roll(wall, 6, axis=1), width)
    perception = pipeline(goal, depth=source, constant_depth_m=2.0)
    depth = None
    if source == "given":
        depth = DepthMap(
            np.full(view.shape[:2], 2.0, np.float32), np.ones(view.shape[:2], np.float32)
        )
    outcome = perception.process_frame(Frame(view, 0, 0), Motion.at_rest(0.0, 0.0), True, depth)
    assert outcome.flow.confidence.shape == (240, 320)
    assert outcome.result.velocity[1] == pytest.approx(RIGHT_M_S, rel=0.05)


@given(st.integers(64, 1920), st.integers(64, 1920), st.sampled_from([320, 400, 640]))
def test_no_image_is_enlarged_and_none_has_more_pixels_than_one_of_4_to_3(w, h, width_px):
    height, width = MatchingConfig(working_width_px=width_px).working_size((h, w))
    assert height <= h
    assert width <= w
    most = 0.75 * width_px**2
    assert height * width <= most + max(height, width)
    assert height * width >= min(h * w, most) - max(height, width)
    assert abs(width / height - w / h) <= (w / h) * (1 / height + 1 / width)


def kept_bytes(width, height):
    """Memory that the pipeline keeps of as many frames as there can be keyframes."""
    wall = Wall(texture(np.random.default_rng(3))).picture()
    view = np.kron(wall[:180], np.ones((height // 180, width // 320, 1), np.uint8))
    perception = pipeline(view, depth="constant")
    tracemalloc.start()
    try:
        for k in range(MOST_KEYFRAMES + 4):
            aside = np.array([0.0, 0.1 * k, 0.0])
            motion = Motion(k * 100 * MS, 0.0, 0.0, 0.0, np.zeros(3), aside)
            perception.process_frame(Frame(view.copy(), k * 100 * MS, k), motion, engaged=False)
        assert len(perception._keyframes) == MOST_KEYFRAMES
        return tracemalloc.get_traced_memory()[0]
    finally:
        tracemalloc.stop()


def test_memory_does_not_grow_with_the_cameras_size_beyond_that_of_the_features():
    """Keyframes hold images of 640 px for the features, whatever the camera has."""
    assert kept_bytes(1280, 720) < 1.05 * kept_bytes(640, 360)
