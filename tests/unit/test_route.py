"""When a goal on the way gives place to the next one."""

from dataclasses import replace

import pytest
from still_pipeline import servo_result

from dfvs_core.perception.route import (
    PREVIEW_PERIOD_NS,
    RESPONSE_NS,
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
ENGAGED = RouteState(engaged_since_ns=0)
LATER = 10 * S


def near(t_ns=LATER, state=ENGAGED, **changes):
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


def test_the_goal_stays_during_the_initial_response_check():
    state = on_result(RouteState(), LIMITS, NEAR, LATER, engaged=True)
    assert not wants_preview(state, LATER + RESPONSE_NS - 1)
    assert wants_preview(state, LATER + RESPONSE_NS)


def test_before_the_vehicle_is_engaged_a_goal_may_be_passed_at_once():
    state = on_result(RouteState(), LIMITS, NEAR, LATER, engaged=False)
    assert wants_preview(state, LATER)


def test_a_goal_in_sight_twice_in_a_row_takes_over():
    state = on_preview(near(), LIMITS, NEAR, LATER)
    assert not may_go_on(state, LATER)
    hidden = servo_result(overlap=0.19)
    again = on_preview(on_preview(state, LIMITS, hidden, LATER), LIMITS, NEAR, LATER)
    assert not may_go_on(again, LATER)
    unsure = servo_result(status=Status.DEGENERATE)
    again = on_preview(on_preview(state, LIMITS, unsure, LATER), LIMITS, NEAR, LATER)
    assert not may_go_on(again, LATER)
    assert may_go_on(on_preview(state, LIMITS, NEAR, LATER), LATER)


def test_a_goal_that_came_in_sight_before_servo_waits_for_the_initial_response_check():
    state = on_preview(on_preview(near(), LIMITS, NEAR, LATER), LIMITS, NEAR, LATER)
    state = on_result(replace(state, engaged_since_ns=None), LIMITS, NEAR, LATER, engaged=True)
    assert not may_go_on(state, LATER + RESPONSE_NS - 1)
    assert may_go_on(state, LATER + RESPONSE_NS)


def test_a_step_away_from_the_goal_begins_the_count_anew():
    state = on_preview(near(), LIMITS, NEAR, LATER)
    assert near(state=state).seen == 1
    assert near(state=state, error_m=0.4).seen == 0


def test_a_next_goal_that_stays_away_is_lost_after_a_while_only():
    state = near()
    assert not is_lost(state, LIMITS, LATER + LIMITS.patience_ns)
    assert is_lost(state, LIMITS, LATER + LIMITS.patience_ns + 1)
    assert not is_lost(
        on_preview(state, LIMITS, NEAR, LATER), LIMITS, LATER + 2 * LIMITS.patience_ns
    )


def test_patience_begins_when_the_initial_response_check_is_over():
    state = on_result(RouteState(), LIMITS, NEAR, 0, engaged=True)
    assert not is_lost(state, LIMITS, RESPONSE_NS + LIMITS.patience_ns)
    assert is_lost(state, LIMITS, RESPONSE_NS + LIMITS.patience_ns + 1)


def test_nothing_is_lost_while_the_vehicle_is_not_engaged():
    state = on_result(RouteState(), LIMITS, NEAR, 0, engaged=False)
    assert not is_lost(state, LIMITS, 100 * S)


def lost_after_s(seconds, *, holds):
    """Time in SERVO, s, until the next goal is lost, of a flight near this one at 15 Hz.

    ``holds``: with a HOLD of 1.2 s every 6.2 s.
    """
    state, servo_s = RouteState(), 0.0
    for k in range(seconds * 15):
        held = holds and k / 15 % 6.2 >= 5.0
        servo_s += 0.0 if held else 1 / 15
        t_ns = k * S // 15
        if held:
            state = on_paused_result(state, LIMITS, NEAR, t_ns)
        else:
            state = on_result(state, LIMITS, NEAR, t_ns, engaged=True)
        if is_lost(state, LIMITS, t_ns):
            return servo_s
    return None


def test_in_hold_the_time_without_the_next_goal_stands_still():
    assert lost_after_s(20, holds=False) == pytest.approx(14.0, abs=0.2)
    assert lost_after_s(30, holds=True) == pytest.approx(14.0, abs=0.2)


def test_a_hold_puts_off_what_the_next_goal_is_waited_for():
    state = on_result(RouteState(), LIMITS, NEAR, 0, engaged=True)
    state = on_paused_result(state, LIMITS, NEAR, 2 * S)
    assert not wants_preview(state, 2 * S + RESPONSE_NS - 1)
    assert wants_preview(state, 2 * S + RESPONSE_NS)
    assert not is_lost(state, LIMITS, 2 * S + RESPONSE_NS + LIMITS.patience_ns)
    assert is_lost(state, LIMITS, 2 * S + RESPONSE_NS + LIMITS.patience_ns + 1)


def test_a_hold_before_the_vehicle_was_engaged_counts_as_not_engaged():
    state = on_paused_result(RouteState(), LIMITS, NEAR, 0)
    state = on_paused_result(state, LIMITS, NEAR, S)
    assert state.engaged_since_ns is None


def test_a_state_other_than_servo_and_hold_begins_the_time_anew():
    state = on_result(RouteState(), LIMITS, NEAR, 0, engaged=True)
    state = on_result(state, LIMITS, NEAR, S, engaged=False)
    assert state.engaged_since_ns is None
