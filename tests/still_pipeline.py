"""Perception of a vehicle that stands still: a pipeline, a matcher, and results of the servo."""

from dataclasses import replace

import numpy as np

from dfvs_core.geometry.camera import CameraModel
from dfvs_core.matching.classical import classical_matcher
from dfvs_core.matching.correspondence import FlowField
from dfvs_core.matching.matcher import ImageFeatures
from dfvs_core.messages.goal import Goal, GoalSidecar, Mount
from dfvs_core.perception.pipeline import Pipeline
from dfvs_core.servo.config import ServoConfig
from dfvs_core.servo.exchange import ServoResult, Status
from dfvs_core.servo.task import ServoTask


class StillMatcher:
    """Always finds the same flow, and notes what it was asked for.

    Without ``flow`` nothing moved, with full confidence in the upper ``share`` of the view.
    """

    def __init__(self, flow=None):
        self.flow, self.share = flow, 1.0
        self.predictions, self.relocalisations, self.extensions = [], 0, 0

    def encode(self, image):
        return ImageFeatures(image.shape[:2])

    def match(self, current, other, *, excluded=()):
        self.relocalisations += 1
        return self._found(current)

    def track(self, current, other, predicted):
        self.predictions.append(predicted)
        return self._found(current)

    def extend(self, current, other, known):
        self.extensions += 1
        return None

    def _found(self, current):
        if self.flow is not None:
            return self.flow
        confidence = np.zeros(current.size, np.float32)
        confidence[: round(self.share * current.size[0])] = 1.0
        return FlowField(np.zeros((*current.size, 2), np.float32), confidence)


def pipeline(goal, matcher=None, now_ns=lambda: 0, **settings):
    """Pipeline to a goal image (H, W, 3) of the same camera; the matcher is the classical one."""
    height, width = goal.shape[:2]
    camera = CameraModel.from_horizontal_fov(width, height, 1.3)
    sidecar = GoalSidecar(camera)
    task = ServoTask(ServoConfig(**settings), camera, sidecar, Mount())
    return Pipeline(task, matcher or classical_matcher(), Goal(goal, sidecar), now_ns)


_NEAR = ServoResult(
    status=Status.OK,
    velocity=np.zeros(4),
    motion=np.zeros(4),
    error_m=0.2,
    error_rad=0.1,
    median_error_px=1.0,
    feature_error=0.1,
    mounting_score=None,
    residual_px=0.2,
    inlier_share=0.9,
    overlap=0.6,
    condition=10.0,
    depth_m=2.0,
    reached=False,
)


def servo_result(**changes):
    """A good result near the goal, with these changes."""
    return replace(_NEAR, **changes)
