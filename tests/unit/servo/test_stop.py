"""The stop rule and the progress check: statistics of the error over a window."""

from dataclasses import replace

import numpy as np
import pytest

from dfvs_core.servo.checks.stop import (
    ErrorSample,
    StopState,
    error_sample,
    is_reached,
    is_stuck,
    update_stop,
    window_error,
)
from dfvs_core.servo.config import ServoConfig
from dfvs_core.servo.goal_filter import GoalEstimate

FRAME_NS = 50_000_000
NONE = np.zeros(3)


def after(offsets, turns=None, engaged=True, feature_error=None, learnt=None):
    """State after frames with these offsets along one axis, or vectors, in tolerances.

    ``learnt`` holds the scale's uncertainty and the position's restarts of each frame.
    """
    state = StopState()
    for k, offset in enumerate(offsets):
        vector = np.array([offset, 0.0, 0.0]) if np.isscalar(offset) else np.array(offset)
        turn = NONE if turns is None else np.array([0.0, 0.0, turns[k]])
        feature = 0.5 if feature_error is None else feature_error[k]
        spread, restarts = (0.0, 0) if learnt is None else learnt[k]
        sample = ErrorSample(k * FRAME_NS, vector, turn, feature, spread, restarts)
        state = update_stop(state, sample, engaged)
    return state


def with_holds(score, seconds, servo_s, hold_s=1.0, feature=lambda t, servo: 0.5):
    """Time at which a flight with a HOLD after every ``servo_s`` is stuck; None if it never is.

    ``score`` and ``feature`` are of the time and of that in SERVO.
    """
    state, in_servo_s = StopState(), 0.0
    for k in range(round(seconds * 1e9 / FRAME_NS)):
        t_s = k * FRAME_NS * 1e-9
        engaged = t_s % (servo_s + hold_s) < servo_s
        in_servo_s += FRAME_NS * 1e-9 if engaged else 0.0
        offset = np.array([score(t_s, in_servo_s), 0.0, 0.0])
        sample = ErrorSample(k * FRAME_NS, offset, NONE, feature(t_s, in_servo_s))
        state = update_stop(state, sample, engaged, paused=not engaged)
        if is_stuck(state, progress_s=5.0):
            return in_servo_s
    return None


def swinging(mean, deviation, seconds, period_s=1.0):
    t = np.arange(0.0, seconds, FRAME_NS * 1e-9)
    return mean + np.sqrt(2.0) * deviation * np.sin(2.0 * np.pi * t / period_s)


def test_errors_are_counted_in_tolerances():
    config = ServoConfig(tolerance_m=0.02, tolerance_rad=0.01)
    x, P = np.array([0.03, 0.0, 0.04, 0.0, 0.0, 0.0, 0.0]), np.diag([0.0] * 6 + [0.25])
    estimate = GoalEstimate(x, P, error_m_s=0.03, slip_m_s=NONE, restarts=2)
    sample = error_sample(0, estimate, np.array([0.0, 0.02, 0.0]), 0.1, config)
    assert sample.score == pytest.approx(2.5)
    assert (sample.scale_spread, sample.restarts) == (0.5, 2)
    turned = error_sample(0, replace(estimate, x=np.zeros(7)), np.array([0, 0.03, 0]), 0.1, config)
    assert turned.score == pytest.approx(3.0)


def test_a_small_steady_error_is_reached_after_a_second():
    assert not is_reached(after([0.8] * 10))
    assert is_reached(after([0.8] * 21))


def test_outside_the_tolerance_nothing_is_reached():
    assert not is_reached(after([1.05] * 80))
    assert not is_reached(after([0.0] * 80, turns=[1.05] * 80))
    assert not is_reached(StopState())


@pytest.mark.parametrize(("spread", "most"), [(0.03, 0.94), (0.6, 0.3)])
def test_a_distance_whose_scale_is_a_guess_has_to_be_shorter(spread, most):
    """Within tolerance even if the scale is two standard deviations larger; the angle is known."""
    for error, reached in ((0.98 * most, True), (1.02 * most, False)):
        learnt = [(spread, 0)] * 21
        assert is_reached(after([error] * 21, turns=[0.9] * 21, learnt=learnt)) == reached


def test_nothing_is_reached_in_passing():
    """A vehicle that flies through the goal has no error on average, and a large spread."""
    passing = np.linspace(10.0, -10.0, 60)
    states = [after(passing[:k]) for k in range(20, 60)]
    assert not any(is_reached(state) for state in states)


def test_an_error_that_swings_about_the_goal_is_none_on_average():
    assert is_reached(after(swinging(0.0, 0.9, 2.0)))


def test_a_vehicle_that_is_moved_about_is_judged_by_three_seconds():
    assert not is_reached(after(swinging(0.5, 3.0, 2.0)))
    assert is_reached(after(swinging(0.5, 3.0, 3.2)))


def test_a_mean_beyond_its_own_uncertainty_is_not_the_goal():
    # The mean of three independent errors of 2 tolerances is known to 1.2.
    assert is_reached(after(swinging(1.9, 2.0, 3.2)))
    assert not is_reached(after(swinging(2.6, 2.0, 3.2)))


def test_whoever_is_thrown_about_has_reached_nothing():
    assert not is_reached(after(swinging(0.0, 6.0, 4.0)))


def test_the_window_tells_mean_and_spread():
    error = window_error(after([(3.0, 4.0, 0.0)] * 30))
    assert error.mean[0] == pytest.approx(5.0)
    assert error.spread[0] == pytest.approx(0.0, abs=1e-9)
    error = window_error(after(swinging(1.0, 0.5, 1.05)))
    assert error.mean[0] == pytest.approx(1.0, abs=0.05)
    assert error.spread[0] == pytest.approx(0.5, rel=0.1)
    assert error.is_full


def at_times(times_ns, offset=0.5):
    """State after frames at these times, ns, with one offset, in tolerances."""
    state = StopState()
    for t_ns in times_ns:
        state = update_stop(state, ErrorSample(t_ns, np.array([offset, 0.0, 0.0]), NONE, 0.5), True)
        yield state


@pytest.mark.parametrize("rate_hz", [5.0, 8.0, 8.5, 9.0, 10.0, 30.0])
def test_the_window_stays_full_however_the_frames_jitter(rate_hz):
    jitter_ns = np.random.default_rng(0).normal(0.0, 4e6, round(20 * rate_hz))
    times_ns = [round(k * 1e9 / rate_hz + jitter) for k, jitter in enumerate(jitter_ns)]
    states = zip(times_ns, at_times(times_ns), strict=True)
    assert all(window_error(state).is_full for t_ns, state in states if t_ns >= 1.25e9)


def test_the_window_is_not_full_before_it_has_passed():
    states = at_times(range(0, 900_000_000, 125_000_000))
    assert not any(window_error(state).is_full for state in states)


def test_frames_before_a_gap_do_not_fill_the_window():
    before = range(0, 1_000_000_000, 125_000_000)
    after_gap = range(1_200_000_000, 2_100_000_000, 125_000_000)
    *_, last = at_times([*before, *after_gap])
    assert not window_error(last).is_full


def test_no_progress_far_away_is_being_stuck():
    frames = int(5.2e9 / FRAME_NS)
    assert is_stuck(after([20.0] * frames), progress_s=5.0)
    assert not is_stuck(after([20.0] * (frames // 2)), progress_s=5.0)


def test_an_angle_that_does_not_fall_is_being_stuck_too():
    frames = int(5.2e9 / FRAME_NS)
    assert is_stuck(after([0.1] * frames, turns=[20.0] * frames), progress_s=5.0)


def test_slow_progress_is_progress():
    assert not is_stuck(after([20.0 * 0.99**k for k in range(200)]), progress_s=5.0)


@pytest.mark.parametrize(("m_s", "is_progress"), [(0.025, True), (0.015, False)])
def test_far_away_a_decimetre_in_five_seconds_is_progress(m_s, is_progress):
    """At the reduced speed of the start a twentieth of 8 m takes longer."""
    tolerances = m_s / ServoConfig().tolerance_m
    frames = np.arange(130) * FRAME_NS * 1e-9
    stuck = is_stuck(after(list(400.0 - tolerances * frames)), progress_s=5.0)
    assert stuck is not is_progress


def test_an_error_whose_scale_was_learnt_late_is_no_lack_of_progress():
    frames = 200
    taken_for_near = [8.0] * 5 + [50.0 * 0.993**k for k in range(frames - 5)]
    falling = [0.5 * 0.993**k for k in range(frames)]
    assert min(taken_for_near[5:]) > 8.0
    assert not is_stuck(after(taken_for_near, feature_error=falling), progress_s=5.0)
    assert is_stuck(after(taken_for_near), progress_s=5.0)


@pytest.mark.parametrize("learnt", [(0.4, 0), (0.6, 1)], ids=["scale", "position"])
def test_errors_begin_anew_once_the_scale_or_another_position_is_known(learnt):
    """The way is four times as long as was believed; the view does not tell that it falls."""
    frames = 150
    offsets = [12.0] * 40 + [48.0 * 0.995**k for k in range(frames - 40)]
    known = [(0.6, 0)] * 40 + [learnt] * (frames - 40)
    assert not is_stuck(after(offsets, learnt=known), progress_s=5.0)
    assert is_stuck(after(offsets), progress_s=5.0)
    standing = [12.0] * 40 + [48.0] * (frames - 40)
    assert is_stuck(after(standing, learnt=known), progress_s=5.0)


def test_a_scale_that_is_hardly_known_better_is_no_progress():
    known = [(0.6 * 0.999**k, 0) for k in range(150)]
    assert is_stuck(after([20.0] * 150, learnt=known), progress_s=5.0)


@pytest.mark.parametrize(("fall", "stuck"), [(0.15, False), (0.0, True)])
def test_a_vehicle_that_comes_back_after_it_passed_the_goal_makes_progress(fall, stuck):
    def score(t_s, _):
        return np.interp(t_s, [0.0, 3.0, 4.0], [40.0, 0.2, 18.0]) * (1.0 - fall) ** max(t_s - 4, 0)

    assert (with_holds(score, 15.0, 60.0) is not None) is stuck


@pytest.mark.parametrize(("decay", "stuck"), [(0.7, False), (1.0, True)])
def test_only_swings_that_decay_are_progress(decay, stuck):
    def score(t_s, _):
        swing, phase = divmod(t_s, 7.0)
        return 0.2 + 20.0 * decay**swing * (1.0 - np.cos(2.0 * np.pi * phase / 7.0))

    assert (with_holds(score, 28.0, 60.0) is not None) is stuck


def test_near_the_goal_no_progress_is_asked_for():
    assert not is_stuck(after([2.9] * 200), progress_s=5.0)


def test_fluctuations_as_large_as_the_error_are_no_lack_of_progress():
    assert not is_stuck(after(swinging(6.0, 4.0, 10.0)), progress_s=5.0)
    assert is_stuck(after(swinging(6.0, 0.5, 10.0)), progress_s=5.0)


@pytest.mark.parametrize("servo_s", [0.5, 2.0, 4.5, 60.0])
@pytest.mark.parametrize("away", [0.0, 5.0])
def test_a_hold_does_not_put_off_that_a_vehicle_is_stuck(servo_s, away):
    stuck_s = with_holds(lambda t, servo: 40.0 + away * servo, 60.0, servo_s)
    # Frames on both sides of a HOLD, 50 ms, count for it.
    assert 5.0 < stuck_s < 5.0 * (1.0 + 0.05 / servo_s) + 0.2


def test_errors_that_fall_in_servo_and_rise_in_holds_are_progress():
    """By a fifth of what a HOLD adds in each period in SERVO."""
    assert with_holds(lambda t, servo: 20.0 + 10.0 * (t - servo) - servo, 120.0, 2.0) is None


@pytest.mark.parametrize("sign", [1.0, -1.0])
def test_what_a_hold_changes_of_an_error_is_no_progress(sign):
    stuck_s = with_holds(lambda t, servo: 100.0 - sign * 10.0 * (t - servo), 60.0, 2.0)
    assert stuck_s == pytest.approx(5.0, abs=0.3)


def test_progress_before_a_hold_counts_after_it():
    """A twentieth takes four of these periods."""
    assert with_holds(lambda t, servo: 20.0 * 0.985**servo, 60.0, 1.0) is None


@pytest.mark.parametrize("wrong", [0.01, 5.0, 400.0])
def test_one_wrong_error_before_a_hold_is_not_held_against_the_flight(wrong):
    def score(t_s, in_servo_s):
        return wrong if 1.9 < t_s % 3.0 < 1.96 else 40.0 * 0.97**in_servo_s

    assert with_holds(score, 60.0, 2.0) is None


def test_an_error_of_zero_before_a_hold_is_not_divided_by():
    state = StopState()
    for k, (offset, engaged) in enumerate([(0.0, True), (8.0, False), (8.0, True)]):
        sample = ErrorSample(k * FRAME_NS, np.array([offset, 0.0, 0.0]), NONE, offset)
        state = update_stop(state, sample, engaged, paused=not engaged)
    assert (state.progress.score, state.progress.feature_error) == (8.0, 8.0)


def test_a_fall_of_the_feature_error_counts_over_holds_as_well():
    def rising_in_holds(t_s, in_servo_s):
        return 0.5 * 0.985**in_servo_s * 1.1 ** (t_s - in_servo_s)

    assert with_holds(lambda t, servo: 40.0, 30.0, 1.0, feature=rising_in_holds) is None


def test_progress_is_asked_for_only_while_engaged():
    assert not is_stuck(after([20.0] * 200, engaged=False), progress_s=5.0)
