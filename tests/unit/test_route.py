"""When a goal on the way gives place to the next one."""

import pytest
from still_pipeline import servo_result

from dfvs_core.perception.route import (
    PREVIEW_PERIOD_NS,
    RouteLimits,
    RouteState,
    S,
    is_lost,
    may_go_on,
    on_paused_result,
    on_preview,
    on_result,
    wants_preview,
)
from dfvs_core.servo.exchange import Status

LIMITS = RouteLimits(near_m=0.3, near_rad=0.2, overlap=0.2, patience_ns=8 * S)
NEAR = servo_result()
START = RouteState()
LATER = 10 * S


def near(t_ns=LATER, state=START, **changes):
    return on_result(state, LIMITS, servo_result(**changes), t_ns, engaged=True)


def test_near_the_goal_the_next_one_is_looked_for_now_and_then():
    state = near()
    assert wants_preview(state, LATER)
    state = on_preview(state, LIMITS, NEAR, LATER)
    assert not wants_preview(state, LATER + PREVIEW_PERIOD_NS - 1)
    assert wants_preview(state, LATER + PREVIEW_PERIOD_NS)


@pytest.mark.parametrize(
    "far", [{"error_m": 0.31}, {"error_rad": 0.21}, {"status": Status.NO_AGREEMENT}]
)
def test_far_from_it_or_unsure_it_is_not(far):
    assert not wants_preview(near(**far), LATER)


def test_before_the_vehicle_is_engaged_a_goal_may_be_passed_at_once():
    state = on_result(START, LIMITS, NEAR, LATER, engaged=False)
    assert wants_preview(state, LATER)


def test_a_goal_in_sight_twice_in_a_row_takes_over():
    state = on_preview(near(), LIMITS, NEAR, LATER)
    assert not may_go_on(state)
    hidden = servo_result(overlap=0.19)
    again = on_preview(on_preview(state, LIMITS, hidden, LATER), LIMITS, NEAR, LATER)
    assert not may_go_on(again)
    unsure = servo_result(status=Status.DEGENERATE)
    again = on_preview(on_preview(state, LIMITS, unsure, LATER), LIMITS, NEAR, LATER)
    assert not may_go_on(again)
    assert may_go_on(on_preview(state, LIMITS, NEAR, LATER))


def test_a_step_away_from_the_goal_begins_the_count_anew():
    state = on_preview(near(), LIMITS, NEAR, LATER)
    assert near(state=state).seen == 1
    assert near(state=state, error_m=0.4).seen == 0


def test_a_next_goal_that_stays_away_is_lost_after_a_while_only():
    state = near(state=near(), t_ns=LATER + LIMITS.patience_ns)
    assert not is_lost(state, LIMITS)
    state = near(state=state, t_ns=LATER + LIMITS.patience_ns + 1)
    assert is_lost(state, LIMITS)
    assert not is_lost(on_preview(state, LIMITS, NEAR, LATER), LIMITS)


def lost_after_s(seconds, *, holds):
    """Time in SERVO, s, until the next goal is lost, of a flight near this one at 15 Hz.

    ``holds``: with a HOLD of 1.2 s every 6.2 s.
    """
    state, servo_s = START, 0.0
    for k in range(seconds * 15):
        held = holds and k / 15 % 6.2 >= 5.0
        servo_s += 0.0 if held else 1 / 15
        t_ns = k * S // 15
        if held:
            state = on_paused_result(state, LIMITS, NEAR, t_ns)
        else:
            state = on_result(state, LIMITS, NEAR, t_ns, engaged=True)
        if is_lost(state, LIMITS):
            return servo_s
    return None


def test_in_hold_the_time_without_the_next_goal_stands_still():
    assert lost_after_s(20, holds=False) == pytest.approx(8.0, abs=0.2)
    assert lost_after_s(30, holds=True) == pytest.approx(8.0, abs=0.2)


def test_a_state_other_than_servo_and_hold_begins_the_time_anew():
    state = near(state=near(t_ns=0), t_ns=LATER)
    assert is_lost(state, LIMITS)
    state = on_result(state, LIMITS, NEAR, LATER + S, engaged=False)
    assert state.near_ns == 0
    assert near(state=state, t_ns=LATER + 2 * S).near_ns == S
