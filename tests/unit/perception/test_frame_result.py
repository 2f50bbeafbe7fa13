"""Result of a frame, as telemetry publishes it."""

import numpy as np
from textured_wall import Wall, texture

from dfvs_core.geometry.camera import CameraModel
from dfvs_core.matching.classical import classical_matcher
from dfvs_core.messages.frame import Frame
from dfvs_core.messages.goal import Goal, GoalSidecar, Mount
from dfvs_core.perception.pipeline import Pipeline
from dfvs_core.perception.vehicle_history import Motion
from dfvs_core.servo.config import ServoConfig
from dfvs_core.servo.task import ServoTask
from dfvs_service.perception.telemetry.messages import servo_document

PERIOD_NS = 40_000_000


def test_telemetry_publishes_the_state_of_the_goal_tracker(rng):
    image, other = (Wall(texture(rng)).picture() for _ in range(2))
    camera = CameraModel.from_horizontal_fov(image.shape[1], image.shape[0], 1.3)
    sidecar = GoalSidecar(camera)
    task = ServoTask(ServoConfig(depth="constant"), camera, sidecar, Mount())
    pipeline = Pipeline(task, classical_matcher(), Goal(image, sidecar), lambda: 0)
    states, coasting = [], []
    for k, view in enumerate((image, image, other, other, other, image)):
        motion = Motion(k * PERIOD_NS, 0.0, 0.0, 0.0, np.zeros(3), np.zeros(3), 0.0)
        frame = Frame(view, k * PERIOD_NS, k)
        result = pipeline.process_frame(frame, motion, engaged=False)
        states.append(servo_document(frame, result, 0, {})["tracking"])
        coasting.append(result.is_coasting)
    assert states == ["tracking", "tracking", "coasting", "lost", "searching", "tracking"]
    assert coasting == [state == "coasting" for state in states]
