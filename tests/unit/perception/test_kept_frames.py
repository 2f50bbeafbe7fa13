"""Memory of the pipeline: which of the kept frames hold features."""

import numpy as np
from textured_wall import Wall, texture

from dfvs_core.camera import CameraModel
from dfvs_core.goal import Goal, GoalSidecar, Mount
from dfvs_core.matching.classical import classical_matcher
from dfvs_core.perception.pipeline import KEPT_FRAMES, Pipeline
from dfvs_core.servo.config import ServoConfig
from dfvs_core.servo.task import ServoTask
from dfvs_core.vehicle_history import Motion
from dfvs_core.wire.frame import Frame


class Encoding:
    """The classical matcher; encodes each image at once, as a relocalisation does."""

    def __init__(self):
        self._matcher = classical_matcher()
        self.match, self.track = self._matcher.match, self._matcher.track
        self.prepared = []

    def prepare(self, image):
        self.prepared.append(self._matcher.prepare(image))
        assert len(self.prepared[-1].features.points) > 0
        return self.prepared[-1]


def test_only_the_goal_and_the_newest_frame_hold_features(rng):
    picture = Wall(texture(rng)).picture()
    camera = CameraModel.from_horizontal_fov(picture.shape[1], picture.shape[0], 1.3)
    sidecar = GoalSidecar(camera)
    task = ServoTask(ServoConfig(depth="constant"), camera, sidecar, Mount())
    matcher = Encoding()
    pipeline = Pipeline(task, matcher, Goal(picture, sidecar), lambda: 0)
    still = Motion(0, 0.0, 0.0, 0.0, np.zeros(3), np.zeros(3), 0.0)
    for k in range(4):
        pipeline.process_frame(Frame(picture, k, k), still, engaged=True)
    assert KEPT_FRAMES > 4
    assert ["features" in vars(each) for each in matcher.prepared] == [
        True,
        False,
        False,
        False,
        True,
    ]
