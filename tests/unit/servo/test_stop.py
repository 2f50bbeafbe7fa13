import math

import pytest

from dfvs_core.servo.config import ServoConfig
from dfvs_core.servo.stop import (
    ErrorScore,
    StopState,
    error_score,
    is_reached,
    is_stuck,
    update_stop,
)

FRAME_NS = 50_000_000


def after(scores, engaged=True, feature_error=None):
    """State after some frames; without a feature error of its own, it never falls."""
    state = StopState()
    for k, score in enumerate(scores):
        error = ErrorScore(k * FRAME_NS, score, 0.5 if feature_error is None else feature_error[k])
        state = update_stop(state, error, engaged)
    return state


def test_the_score_is_the_worse_of_distance_and_angle():
    config = ServoConfig(tolerance_m=0.02, tolerance_rad=0.01)
    assert error_score(0.01, 0.02, config) == pytest.approx(2.0)
    assert error_score(0.06, 0.001, config) == pytest.approx(3.0)


def test_a_small_steady_error_at_rest_is_reached():
    assert is_reached(after([0.8] * 20), speed_m_s=0.01, asked_m_s=0.0)


def test_nothing_is_reached_in_passing():
    assert not is_reached(after([0.8] * 20), speed_m_s=0.1, asked_m_s=0.0)


def test_a_vehicle_that_must_be_pushed_to_stay_has_not_arrived():
    assert is_reached(after([0.3] * 20), speed_m_s=0.0, asked_m_s=0.02)
    assert not is_reached(after([0.3] * 20), speed_m_s=0.0, asked_m_s=0.04)


def test_an_error_that_still_falls_is_waited_for():
    falling = [3.0 * 0.9**k for k in range(14)]
    assert 0.4 < falling[-1] < 1.0
    assert not is_reached(after(falling), speed_m_s=0.01, asked_m_s=0.0)


def test_far_inside_the_tolerance_nobody_waits():
    assert is_reached(after([3.0, 1.0, 0.3]), speed_m_s=0.01, asked_m_s=0.0)


def test_outside_the_tolerance_nothing_is_reached():
    assert not is_reached(after([1.01] * 20), speed_m_s=0.0, asked_m_s=0.0)
    assert not is_reached(StopState(), speed_m_s=0.0, asked_m_s=0.0)


def test_no_progress_far_away_is_being_stuck():
    frames = int(5.2e9 / FRAME_NS)
    assert is_stuck(after([20.0] * frames), progress_s=5.0)
    assert not is_stuck(after([20.0] * (frames // 2)), progress_s=5.0)


def test_slow_progress_is_progress():
    assert not is_stuck(after([20.0 * 0.99**k for k in range(200)]), progress_s=5.0)


def test_an_error_whose_scale_was_learnt_late_is_no_lack_of_progress():
    frames = 200
    taken_for_near = [8.0] * 5 + [50.0 * 0.993**k for k in range(frames - 5)]
    falling = [0.5 * 0.993**k for k in range(frames)]
    assert min(taken_for_near[5:]) > 8.0
    assert not is_stuck(after(taken_for_near, feature_error=falling), progress_s=5.0)
    assert is_stuck(after(taken_for_near), progress_s=5.0)


def test_going_round_in_circles_is_being_stuck():
    circling = [20.0 + 15.0 * math.sin(0.1 * k) for k in range(400)]
    errors = [0.5 + 0.4 * math.sin(0.1 * k) for k in range(400)]
    assert is_stuck(after(circling, feature_error=errors), progress_s=5.0)


def test_hovering_just_outside_the_tolerance_is_not_being_stuck():
    assert not is_stuck(after([2.0] * 200), progress_s=5.0)


def test_before_engaging_nobody_asks_for_progress():
    assert not is_stuck(after([20.0] * 200, engaged=False), progress_s=5.0)


def test_an_overshoot_in_progress_is_not_the_goal():
    rising = [0.45 + 0.03 * k for k in range(14)]
    assert rising[-1] < 1.0
    assert not is_reached(after(rising), speed_m_s=0.01, asked_m_s=0.0)
