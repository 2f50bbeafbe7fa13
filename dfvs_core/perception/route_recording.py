"""Route recording: decision when the next goal image is due."""

import enum
from dataclasses import dataclass

from dfvs_core.servo.exchange import ServoResult, Status


class KeyframeDecision(enum.Enum):
    """Decision on a frame for the route that is recorded."""

    NEAR = "the last goal is still near"
    DUE = "the next goal is due"
    LOST = "the last goal is out of sight"


@dataclass(frozen=True, slots=True)
class RouteRecordingLimits:
    """How far apart goals are taken; the later flight needs the same overlap and some reserve.

    ``overlap`` is the share of the view that still shows the last goal, relative to the share that
    did at first (a plain wall is never trusted as a whole), ``turn_rad`` the angle to it,
    ``distance`` the way to it over the scene's depth. Below ``stillness``, distance and angle
    together, the vehicle has not moved.
    """

    overlap: float = 0.55
    turn_rad: float = 0.35
    distance: float = 0.3
    stillness: float = 0.05


def evaluate(
    result: ServoResult, limits: RouteRecordingLimits, full_overlap: float
) -> KeyframeDecision:
    """Judge a frame by its result for the last goal.

    ``full_overlap`` is the greatest overlap with that goal so far. The next one is due while the
    last one is in sight for certain, so that the way back can be found.
    """
    if result.status is not Status.OK and result.status is not Status.STUCK:
        return KeyframeDecision.LOST
    distance = result.distance_over_depth
    if distance + result.error_rad < limits.stillness:
        return KeyframeDecision.NEAR
    far = distance > limits.distance or result.error_rad > limits.turn_rad
    is_leaving = result.overlap < limits.overlap * full_overlap
    return KeyframeDecision.DUE if far or is_leaving else KeyframeDecision.NEAR
