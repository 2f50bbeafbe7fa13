"""Perception of cameras that are larger than the working size."""

import numpy as np
import pytest
from still_pipeline import pipeline
from textured_wall import Wall, texture

from dfvs_core.depth.depth_map import DepthMap
from dfvs_core.messages.frame import Frame
from dfvs_core.perception.vehicle_history import Motion

RIGHT_M_S = 0.107
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
