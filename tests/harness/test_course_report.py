"""The course on its way to the gate: from the vehicle's motion and the pictures to the report."""

import numpy as np
import pytest
from box_room import BoxRoom

from dfvs_core.camera import CameraModel
from dfvs_core.goal import Goal, GoalSidecar, Mount
from dfvs_core.matching.matcher import Prepared
from dfvs_core.pipeline import Pipeline
from dfvs_core.poses import make_pose, rotation_from_euler
from dfvs_core.servo.config import ServoConfig
from dfvs_core.servo.task import ServoTask
from dfvs_core.vehicle_history import Motion
from dfvs_core.wire.frame import Frame

CAMERA = CameraModel.from_horizontal_fov(160, 120, np.radians(75))
ROOM = BoxRoom(CAMERA)
PERIOD_NS = 50_000_000


class ExactMatcher:
    """Knows where the camera is; pictures do not matter."""

    def __init__(self, T_world_goal):
        self.T_world_goal = T_world_goal
        self.T_world_camera = T_world_goal

    def prepare(self, image):
        return Prepared(image.shape[:2])

    def match(self, current, other, guess=None, *, besides=()):
        return ROOM.flow(self.T_world_camera, self.T_world_goal)

    def track(self, current, other, guess):
        return self.match(current, other)


def course_reported(mounted_deg, turn_deg):
    """What is reported of a vehicle that drifts aside, engages, and then flies ahead and turns.

    The settings say that the camera looks ahead; it is mounted ``mounted_deg`` further round.
    """
    T_body_camera = Mount(yaw_rad=np.radians(mounted_deg)).T_body_camera()
    T_goal = make_pose(np.eye(3), np.array([0.6, 0.1, 0.05])) @ T_body_camera
    matcher, sidecar = ExactMatcher(T_goal), GoalSidecar(CAMERA)
    picture = np.random.default_rng(0).integers(0, 255, (120, 160, 3)).astype(np.uint8)
    task = ServoTask(ServoConfig(depth="constant"), CAMERA, sidecar, Mount())
    pipeline = Pipeline(task, matcher, Goal(picture, sidecar), lambda: 0)
    drift = [(np.array([0.0, -0.05 * k, 0.0]), 0.0) for k in (4, 3, 2, 1)]
    flight = [(np.array([0.01 * k, 0.0, 0.0]), k / 6 * np.radians(turn_deg)) for k in range(7)]
    last = drift[0][0]
    for k, (position, yaw_rad) in enumerate(drift + flight):
        t_ns = 10**9 + k * PERIOD_NS
        pose = make_pose(rotation_from_euler(0.0, 0.0, yaw_rad), position)
        matcher.T_world_camera = pose @ T_body_camera
        velocity = (position - last) / (PERIOD_NS * 1e-9)
        motion = Motion(t_ns, 0.0, 0.0, yaw_rad, velocity, position)
        frame, last = Frame(picture, t_ns, k), position
        report = pipeline.process(frame, motion, engaged=k > len(drift)).report
    return report.course_agreement


@pytest.mark.parametrize("turn_deg", [0.0, 3.0, -5.0])
def test_the_report_tells_how_the_camera_is_mounted(turn_deg):
    """What was flown before the vehicle followed is no part of it; what it turned is known."""
    assert course_reported(0.0, turn_deg) > 0.95
    assert course_reported(180.0, turn_deg) < -0.95
