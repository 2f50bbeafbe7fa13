"""What the pipeline keeps of earlier frames: enough to track to, and no more."""

import numpy as np
from textured_wall import Wall, texture

from dfvs_core.camera import CameraModel
from dfvs_core.goal import Goal, GoalSidecar, Mount
from dfvs_core.matching.classical import ClassicalMatcher, ClassicalPicture
from dfvs_core.pipeline import KEPT_FRAMES, Pipeline
from dfvs_core.servo.config import ServoConfig
from dfvs_core.servo.task import ServoTask
from dfvs_core.vehicle_history import Motion
from dfvs_core.wire.frame import Frame


class Searching(ClassicalMatcher):
    """Asks every picture for its features, as a search does, and remembers the pictures."""

    def __init__(self) -> None:
        self.pictures: list[ClassicalPicture] = []

    def prepare(self, image):
        self.pictures.append(super().prepare(image))
        assert len(self.pictures[-1].features) > 0
        return self.pictures[-1]


def test_only_the_goal_and_the_newest_frame_keep_what_a_search_needs(rng):
    picture = Wall(texture(rng)).picture()
    camera = CameraModel.from_horizontal_fov(picture.shape[1], picture.shape[0], 1.3)
    sidecar = GoalSidecar(camera)
    task = ServoTask(ServoConfig(depth="constant"), camera, sidecar, Mount())
    matcher = Searching()
    pipeline = Pipeline(task, matcher, Goal(picture, sidecar), lambda: 0)
    still = Motion(0, 0.0, 0.0, 0.0, np.zeros(3), np.zeros(3), 0.0)
    for k in range(4):
        pipeline.process(Frame(picture, k, k), still, engaged=True)
    assert KEPT_FRAMES > 4
    assert ["features" in vars(p) for p in matcher.pictures] == [True, False, False, False, True]
