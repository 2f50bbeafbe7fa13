"""Working size of images of any shape, and what memory depends on."""

import tracemalloc

import numpy as np
from hypothesis import given
from hypothesis import strategies as st
from still_pipeline import pipeline
from textured_wall import Wall, texture

from dfvs_core.matching.config import MatchingConfig
from dfvs_core.messages.frame import Frame
from dfvs_core.perception.keyframes import MOST_KEYFRAMES
from dfvs_core.perception.vehicle_history import Motion

MS = 1_000_000


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
