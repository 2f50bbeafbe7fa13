"""Where the published law ends: by the photometric error as its code reckons it."""

import numpy as np
import pytest

from dfvs_bench.methods.method import GoalObservation, Observation
from dfvs_bench.methods.published import PublishedMethod
from dfvs_core.depth.depth_map import DepthMap
from dfvs_core.geometry.camera import CameraModel
from dfvs_core.matching.correspondence import FlowField
from dfvs_core.matching.matcher import ImageFeatures

CAMERA = CameraModel.from_horizontal_fov(64, 48, np.radians(90))
SHAPE = (CAMERA.height, CAMERA.width)
GOAL = np.full((*SHAPE, 3), 100, np.uint8)
DEPTH = DepthMap(np.ones(SHAPE, np.float32), np.ones(SHAPE, np.float32))


class Shift:
    """A matcher that sees everything one pixel to the right."""

    def encode(self, image):
        return ImageFeatures(SHAPE)

    def match(self, current, other, *, excluded=()):
        flow = np.zeros((*SHAPE, 2), np.float32)
        flow[..., 0] = 1.0
        return FlowField(flow, np.ones(SHAPE, np.float32))

    def track(self, current, other, predicted):
        return None


@pytest.mark.parametrize(
    ("off", "done"),
    [
        ((12, 12, 12), True),  # 3 * 144 = 432 of 500
        ((14, 14, 14), False),  # 588, though each colour's own is 196
        ((22, 0, 0), True),
        ((23, 0, 0), False),
    ],
)
def test_it_ends_where_the_three_colours_errors_add_up_to_less_than_500(off, done):
    image = GOAL + np.array(off, np.uint8)
    method = PublishedMethod(GoalObservation(CAMERA, GOAL, DEPTH), Shift())
    decision = method.decide(Observation(0, image, DEPTH, np.eye(4)))
    assert decision.done == done
    assert decision.error == pytest.approx(np.linalg.norm(off))
