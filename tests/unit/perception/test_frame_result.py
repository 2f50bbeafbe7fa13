"""Result of a frame: derived once, from the servo step's and the check of the view."""

import numpy as np
import pytest

from dfvs_core.perception.frame_result import ViewCheck, conclude
from dfvs_core.servo.exchange import ServoResult, Verdict


def servo(verdict=Verdict.OK):
    return ServoResult(
        verdict=verdict,
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
    assert (result.verdict, result.reached) == (Verdict.OK, False)
    assert result.velocity[0] == 0.1


@pytest.mark.parametrize(
    ("view", "verdict"),
    [
        (ViewCheck.FALSE_GOAL, Verdict.MISTAKEN),
        (ViewCheck.SWAPPED_CHANNELS, Verdict.WRONG_COLOURS),
    ],
)
def test_a_view_that_is_not_the_goals_is_not_flown(view, verdict):
    result = conclude(servo(), view)
    assert (result.verdict, result.reached) == (verdict, False)
    assert not result.velocity.any()
