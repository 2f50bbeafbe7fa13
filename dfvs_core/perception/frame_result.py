"""Result of one frame, and the report made from it."""

import math
from dataclasses import dataclass

from dfvs_core.matching.correspondence import FlowField
from dfvs_core.messages.frame import Frame
from dfvs_core.messages.link import PerceptionReport
from dfvs_core.perception.goal_tracker import TrackingState
from dfvs_core.servo.exchange import ServoResult, Status

STAGES = ("prepare", "match", "servo")

UNKNOWN_ERROR = 1e6
"""Stands for an error that could not be estimated: the wire carries finite numbers only."""


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
    def is_coasting(self) -> bool:
        """Whether the goal was not tracked in this one frame: it counts as one that did not come.

        The gate is not told of it. The last good frame counts for as long as its age allows.
        """
        is_coasting = self.tracking is TrackingState.COASTING
        return is_coasting and self.result.status is Status.NO_OVERLAP

    @property
    def report(self) -> PerceptionReport:
        """Report for the gate; only of a vehicle's four degrees of freedom."""
        result, ok = self.result, self.result.status is Status.OK
        forward, right, down, yaw_rate = (float(v) for v in result.velocity)
        return PerceptionReport(
            seq=self.frame.seq,
            t_capture_ns=self.frame.t_capture_ns,
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
