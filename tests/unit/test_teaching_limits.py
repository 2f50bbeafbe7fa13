"""When the next goal of a taught route is due."""

import pytest
from still_pipeline import servo_result

from dfvs_core.perception.route import KeyframeDecision, RouteRecordingLimits, evaluate
from dfvs_core.servo.exchange import Status

LIMITS = RouteRecordingLimits(overlap=0.5, turn_rad=0.35, distance=0.3, stillness=0.05)


def lesson(full_overlap=0.7, **changes):
    return evaluate(servo_result(**{"overlap": 0.4} | changes), LIMITS, full_overlap)


def test_a_goal_is_due_when_the_last_one_is_far_turned_away_or_leaving():
    assert lesson() is KeyframeDecision.NEAR
    assert lesson(error_m=0.61) is KeyframeDecision.DUE
    assert lesson(error_rad=0.36) is KeyframeDecision.DUE
    assert lesson(overlap=0.34) is KeyframeDecision.DUE


def test_a_plain_view_that_was_never_trusted_as_a_whole_is_not_leaving():
    assert lesson(overlap=0.2, full_overlap=0.3) is KeyframeDecision.NEAR
    assert lesson(overlap=0.14, full_overlap=0.3) is KeyframeDecision.DUE


def test_a_vehicle_that_stands_still_takes_one_picture():
    assert lesson(overlap=0.1, error_m=0.04, error_rad=0.02) is KeyframeDecision.NEAR


@pytest.mark.parametrize(
    "status", [Status.NO_OVERLAP, Status.NO_AGREEMENT, Status.DEGENERATE, Status.NOT_FINITE]
)
def test_without_a_sure_match_the_route_is_lost(status):
    assert lesson(status=status) is KeyframeDecision.LOST
    assert lesson(status=Status.STUCK) is KeyframeDecision.NEAR
