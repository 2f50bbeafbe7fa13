"""Perception of cameras that are larger than the working size."""

import numpy as np
import pytest
from textured_wall import Wall, texture

from dfvs_core.depth.depth_map import DepthMap
from dfvs_core.geometry.camera import CameraModel
from dfvs_core.matching.classical import classical_matcher
from dfvs_core.messages.frame import Frame
from dfvs_core.messages.goal import Goal, GoalSidecar
from dfvs_core.perception.pipeline import Pipeline
from dfvs_core.perception.vehicle_history import Motion
from dfvs_core.servo.config import ServoConfig
from dfvs_core.servo.task import ServoTask

RIGHT_M_S = 0.107
"""Velocity of a camera of 320 px that sees the goal 6 px too far to the right."""
STILL = Motion(0, 0.0, 0.0, 0.0, np.zeros(3), np.zeros(3), 0.0)


def enlarged(picture, width):
    return np.kron(picture, np.ones((width // 320, width // 320, 1), np.uint8))


@pytest.mark.parametrize("source", ["constant", "given"])
@pytest.mark.parametrize("width", [320, 640, 1280])
def test_a_camera_of_any_size_is_asked_for_the_same_velocity(source, width):
    wall = Wall(texture(np.random.default_rng(3))).picture()
    goal, view = enlarged(wall, width), enlarged(np.roll(wall, 6, axis=1), width)
    camera = CameraModel.from_horizontal_fov(width, width * 3 // 4, 1.3)
    sidecar = GoalSidecar(camera)
    task = ServoTask(ServoConfig(depth=source, constant_depth_m=2.0), camera, sidecar)
    pipeline = Pipeline(task, classical_matcher(), Goal(goal, sidecar), lambda: 0)
    depth = None
    if source == "given":
        depth = DepthMap(
            np.full(view.shape[:2], 2.0, np.float32), np.ones(view.shape[:2], np.float32)
        )
    outcome = pipeline.process_frame(Frame(view, 0, 0), STILL, True, depth)
    assert outcome.flow.confidence.shape == (240, 320)
    assert outcome.result.velocity[0] == pytest.approx(RIGHT_M_S, rel=0.05)
