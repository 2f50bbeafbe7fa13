"""Result of one frame, and what the gate is told of it."""

from __future__ import annotations

import math
from dataclasses import dataclass, replace
from enum import Enum

import numpy as np

from dfvs_core.correspondence import FlowField
from dfvs_core.perception.goal_tracker import TrackingState
from dfvs_core.servo.exchange import ServoResult, Status
from dfvs_core.wire.frame import Frame
from dfvs_core.wire.link import PerceptionReport

STAGES = ("prepare", "match", "servo")

UNKNOWN_ERROR = 1e6
"""Stands for an error that could not be estimated: the wire carries finite numbers only."""


class ViewCheck(Enum):
    """Whether a view may be the goal's.

    DOUBTFUL: it counts as the goal and does not match its image, but not for long.
    """

    PASSED = "passed"
    DOUBTFUL = "doubtful"
    FALSE_GOAL = "false goal"
    SWAPPED_CHANNELS = "swapped channels"


_REFUSED = {
    ViewCheck.FALSE_GOAL: Status.FALSE_GOAL,
    ViewCheck.SWAPPED_CHANNELS: Status.SWAPPED_CHANNELS,
}


def conclude(servo: ServoResult, view: ViewCheck) -> ServoResult:
    """Result of a frame from the servo step's and the check of its view.

    A frame that is refused has no velocity; only a view that passed has reached the goal.
    """
    if view is ViewCheck.PASSED:
        return servo
    if view not in _REFUSED:
        return replace(servo, reached=False)
    nothing = np.zeros_like(servo.velocity)
    return replace(servo, status=_REFUSED[view], velocity=nothing, reached=False)


@dataclass(frozen=True, slots=True)
class FrameResult:
    """Result of one frame.

    ``stages_ns`` holds the time that each of ``STAGES`` took; ``now_ns`` is the time at which the
    servo step judged the frame's age; ``tracking`` is the goal tracker's state after the frame.
    """

    frame: Frame
    result: ServoResult
    flow: FlowField
    stages_ns: dict[str, int]
    now_ns: int
    tracking: TrackingState

    @property
    def report(self) -> PerceptionReport:
        """What the gate is told; only of a vehicle's four degrees of freedom."""
        return make_report(self.frame, self.result)


def make_report(frame: Frame, result: ServoResult) -> PerceptionReport:
    """What the gate is told about a frame."""
    ok = result.status is Status.OK
    forward, right, down, yaw_rate = (float(v) for v in result.velocity)
    return PerceptionReport(
        seq=frame.seq,
        t_capture_ns=frame.t_capture_ns,
        velocity=(forward, right, down, yaw_rate),
        healthy=ok,
        reached=result.reached,
        lost=result.status is Status.STUCK,
        reason="" if ok else result.status.value,
        error_m=_finite(result.error_m),
        error_rad=_finite(result.error_rad),
        overlap=result.overlap,
        feature_error=_finite(result.feature_error),
        mounting_score=result.mounting_score,
    )


def _finite(value: float) -> float:
    return value if math.isfinite(value) else UNKNOWN_ERROR
