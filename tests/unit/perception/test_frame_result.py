"""Result of a frame: derived once, from the servo step's and the check of the view."""

import numpy as np
import pytest
from textured_wall import Wall, texture

from dfvs_core.camera import CameraModel
from dfvs_core.goal import Goal, GoalSidecar, Mount
from dfvs_core.matching.classical import classical_matcher
from dfvs_core.perception.frame_result import ViewCheck, conclude
from dfvs_core.perception.pipeline import Pipeline
from dfvs_core.servo.config import ServoConfig
from dfvs_core.servo.exchange import ServoResult, Status
from dfvs_core.servo.task import ServoTask
from dfvs_core.vehicle_history import Motion
from dfvs_core.wire.frame import Frame
from dfvs_service.perception.messages import servo_document

PERIOD_NS = 40_000_000


def servo(status=Status.OK):
    return ServoResult(
        status=status,
        velocity=np.array([0.1, 0.0, 0.0, 0.2]),
        motion=np.zeros(4),
        error_m=0.01,
        error_rad=0.0,
        feature_error_px=0.1,
        feature_error=0.001,
        mounting_score=None,
        residual_px=0.1,
        inlier_share=1.0,
        overlap=1.0,
        condition=1.0,
        depth_m=2.0,
        reached=True,
    )


def test_a_view_that_passed_changes_nothing():
    result = servo()
    assert conclude(result, ViewCheck.PASSED) is result


def test_a_doubtful_view_is_flown_and_has_not_reached_the_goal():
    result = conclude(servo(), ViewCheck.DOUBTFUL)
    assert (result.status, result.reached) == (Status.OK, False)
    assert result.velocity[0] == 0.1


@pytest.mark.parametrize(
    ("view", "status"),
    [
        (ViewCheck.FALSE_GOAL, Status.FALSE_GOAL),
        (ViewCheck.SWAPPED_CHANNELS, Status.SWAPPED_CHANNELS),
    ],
)
def test_a_view_that_is_not_the_goals_is_not_flown(view, status):
    result = conclude(servo(), view)
    assert (result.status, result.reached) == (status, False)
    assert not result.velocity.any()


def test_telemetry_publishes_the_state_of_the_goal_tracker(rng):
    image, other = (Wall(texture(rng)).picture() for _ in range(2))
    camera = CameraModel.from_horizontal_fov(image.shape[1], image.shape[0], 1.3)
    sidecar = GoalSidecar(camera)
    task = ServoTask(ServoConfig(depth="constant"), camera, sidecar, Mount())
    pipeline = Pipeline(task, classical_matcher(), Goal(image, sidecar), lambda: 0)
    states = []
    for k, view in enumerate((image, image, other, other, other, image)):
        motion = Motion(k * PERIOD_NS, 0.0, 0.0, 0.0, np.zeros(3), np.zeros(3), 0.0)
        frame = Frame(view, k * PERIOD_NS, k)
        result = pipeline.process_frame(frame, motion, engaged=False)
        states.append(servo_document(frame, result, 0, {})["tracking"])
    assert states == ["tracking", "tracking", "coasting", "lost", "searching", "tracking"]
