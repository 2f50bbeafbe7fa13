"""What the gate does by the initial-response check."""

import dataclasses

import pytest
from gate_rehearsal import TICK_NS, Rehearsal, auto_config
from initial_motion import TIMING, TURN, Motion, errors

from dfvs_core.gate.checks.initial_response import Response
from dfvs_core.gate.config import MS, S
from dfvs_core.gate.events import Action, BadReport
from dfvs_core.gate.limits import ZERO
from dfvs_core.gate.states import Cause, GateState


def speeds(gate):
    return [v.speed_m_s for _, v in gate.setpoints]


def test_the_first_second_is_flown_at_reduced_speed():
    gate = Rehearsal(auto_config()).until(GateState.SERVO).forget()
    gate.run(1.0)
    end_ns = gate.machine.since_ns + TIMING.response_ns
    first = [v.speed_m_s for t, v in gate.setpoints if t < end_ns]
    assert max(first) == pytest.approx(0.1)
    gate.run(2.0)
    assert speeds(gate)[-1] == pytest.approx(0.4)


def test_a_mounting_known_to_be_right_does_not_shorten_it():
    gate = Rehearsal(auto_config(), changes={"mounting_score": 50.0}, fall_m_s=0.0)
    gate.until(GateState.SERVO).forget().run(0.98)
    assert max(speeds(gate)) <= 0.1 + 1e-12
    gate.run(1.0)
    assert max(speeds(gate)) > 0.3


@pytest.mark.parametrize("fall_m_s", [-0.15, -0.01, 0.0])
def test_an_error_that_does_not_fall_aborts_after_six_seconds(fall_m_s):
    gate = Rehearsal(auto_config(), error_m=2.0, fall_m_s=fall_m_s).until(GateState.SERVO)
    start_ns = gate.now_ns
    gate.until(GateState.ABORT)
    assert gate.last.cause is Cause.ERROR_NOT_FALLING
    assert gate.now_ns - start_ns == TIMING.response_limit_ns
    assert max(speeds(gate)) <= 0.1 + 1e-12


@pytest.mark.parametrize("score", [-6.0, -99.0])
def test_a_wrong_mounting_aborts_in_the_step_that_tells_of_it(score):
    gate = Rehearsal(auto_config()).until(GateState.SERVO).run(0.3)
    assert gate.moved()
    output = gate.look(mounting_score=score)
    assert (gate.state, gate.last.cause) == (GateState.ABORT, Cause.WRONG_MOUNTING)
    assert output.setpoint == ZERO


def test_once_confirmed_a_wrong_mounting_ends_the_flight_as_well():
    gate = Rehearsal(auto_config()).until(GateState.SERVO).run(1.5)
    gate.look(mounting_score=-5.0)
    assert gate.state is GateState.ABORT
    assert gate.last.cause is Cause.WRONG_MOUNTING
    assert gate.last.detail == "5 standard deviations; is it mounted as camera.mount says?"


@pytest.mark.parametrize("age_ms", [201, 240])
def test_a_late_result_shows_nothing_of_the_mounting(age_ms):
    gate = Rehearsal(auto_config()).until(GateState.SERVO).run(0.3)
    gate.sees = False
    gate.run(0.1)
    seen_ns = gate.machine.perception.last_capture_ns
    gate.now_ns = seen_ns + MS + age_ms * MS
    gate.send([gate.report(mounting_score=-9.0, t_capture_ns=seen_ns + MS)])
    assert gate.state is GateState.SERVO
    assert gate.machine.perception.last_capture_ns == seen_ns


def test_a_repeated_frame_is_one_observation():
    gate = Rehearsal(auto_config()).until(GateState.SERVO).run(0.3)
    seen = len(gate.machine._engagement.response.errors)
    for _ in range(5):
        gate.now_ns += MS
        gate.send([gate.report(t_capture_ns=gate.machine.perception.last_capture_ns)])
    assert len(gate.machine._engagement.response.errors) == seen > 0


def test_a_vehicle_that_answers_late_is_waited_for_at_reduced_speed():
    gate = Rehearsal(auto_config(), fall_m_s=0.0)
    gate.vehicle.follows = 0.0
    gate.until(GateState.SERVO).run(2.5)
    assert gate.state is GateState.SERVO
    assert speeds(gate)[-1] == pytest.approx(0.1)
    gate.vehicle.follows = 1.0
    gate.fall_m_s = 0.1
    gate.run(3.0)
    assert gate.state is GateState.SERVO
    assert max(speeds(gate)[-5:]) > 0.3


@pytest.mark.parametrize("follows", [0.0, -1.0])
def test_a_vehicle_that_does_not_follow_aborts_after_six_seconds(follows):
    gate = Rehearsal(auto_config())
    gate.vehicle.follows = follows
    gate.until(GateState.SERVO)
    start_ns = gate.now_ns
    gate.until(GateState.ABORT)
    assert gate.last.cause is Cause.ERROR_NOT_FALLING
    assert "the vehicle moved" in gate.last.detail
    assert TIMING.response_limit_ns <= gate.now_ns - start_ns <= TIMING.response_limit_ns + TICK_NS


def test_after_a_hold_the_least_time_begins_anew():
    gate = Rehearsal(auto_config()).until(GateState.SERVO).run(0.8)
    gate.send([gate.report(healthy=False)])
    gate.until(GateState.SERVO).forget().run(0.98)
    assert max(speeds(gate)) <= 0.1 + 1e-12


def with_holds(gate, servo_s, seconds):
    """Fly on, with an unhealthy report after each ``servo_s`` in SERVO; returns the time in it."""
    end_ns, flown_ns, period_ns = gate.now_ns + round(seconds * S), 0, 0
    while gate.state in (GateState.SERVO, GateState.HOLD) and gate.now_ns < end_ns:
        if gate.state is GateState.SERVO:
            flown_ns, period_ns = flown_ns + TICK_NS, period_ns + TICK_NS
        if period_ns >= round(servo_s * S):
            period_ns = 0
            gate.tick(gate.report(healthy=False, reason="too little"))
        else:
            gate.tick()
    return flown_ns / S


@pytest.mark.parametrize("servo_s", [0.5, 0.98, 2.5, 4.5, 5.5])
def test_holds_do_not_put_off_the_end_of_a_flight_whose_error_does_not_fall(servo_s):
    gate = Rehearsal(auto_config(), error_m=2.0, fall_m_s=-0.1).until(GateState.SERVO)
    flown_s = with_holds(gate, servo_s, 60.0)
    assert (gate.state, gate.last.cause) == (GateState.ABORT, Cause.ERROR_NOT_FALLING)
    assert flown_s == pytest.approx(6.0, abs=0.3)


@pytest.mark.parametrize("servo_s", [0.5, 0.98, 2.0])
def test_an_error_that_falls_in_servo_and_rises_in_holds_ends_no_flight(servo_s):
    """A vehicle drifts while zeros are sent."""
    gate = Rehearsal(auto_config(), error_m=5.0, fall_m_s=0.1).until(GateState.SERVO)
    for _ in range(8):
        with_holds(gate, servo_s, 0.01 + servo_s)
        gate.error_m += 0.5
        gate.until(GateState.SERVO, 2.5)
    gate.run(1.5)
    assert gate.state is GateState.SERVO
    assert speeds(gate)[-1] > 0.3  # confirmed


def test_a_commanded_hold_does_not_put_it_off_either():
    gate = Rehearsal(auto_config(), error_m=2.0, fall_m_s=-0.1).until(GateState.SERVO).run(4.0)
    gate.command(Action.HOLD)
    gate.run(20.0)
    gate.command(Action.ENGAGE)
    gate.until(GateState.SERVO).until(GateState.ABORT, 2.2)
    assert gate.last.cause is Cause.ERROR_NOT_FALLING


def test_another_goal_and_another_engagement_begin_with_a_check_of_their_own():
    gate = Rehearsal(auto_config(), error_m=2.0, fall_m_s=-0.1).until(GateState.SERVO).run(4.0)
    gate.command(Action.HOLD)
    gate.command(Action.GOAL, "ab" * 32)
    gate.command(Action.ENGAGE)
    gate.until(GateState.SERVO)
    assert with_holds(gate, 99.0, 9.0) == pytest.approx(6.0, abs=0.1)
    assert gate.last.cause is Cause.ERROR_NOT_FALLING
    gate.run(2.0)
    gate.command(Action.ENGAGE)
    gate.until(GateState.SERVO)
    assert with_holds(gate, 99.0, 9.0) == pytest.approx(6.0, abs=0.1)


def test_once_confirmed_a_hold_does_not_ask_for_it_again():
    gate = Rehearsal(auto_config()).until(GateState.SERVO).run(2.0)
    gate.send([gate.report(healthy=False)])
    gate.until(GateState.SERVO).forget().run(0.9)
    assert max(speeds(gate)) > 0.3


@pytest.mark.parametrize(("response_ns", "speed_m_s"), [(0, 0.4), (1, 0.1)])
def test_without_a_time_for_it_no_check_is_made(response_ns, speed_m_s):
    config = auto_config(timing=dataclasses.replace(TIMING, response_ns=response_ns))
    gate = Rehearsal(config, fall_m_s=0.0)
    gate.vehicle.follows = 0.0  # and so shows no response
    gate.until(GateState.SERVO).run(1.5)
    assert speeds(gate)[-1] == pytest.approx(speed_m_s)


def test_an_error_within_tolerance_need_not_fall():
    """A vehicle that starts at its goal and is asked to stay there against its own drift."""
    config = auto_config(timing=dataclasses.replace(TIMING, reached_ns=9 * S))
    gate = Rehearsal(config, fall_m_s=0.0, asked=(0.03, 0.0, 0.0, 0.0))
    gate.changes = {"reached": True}
    gate.until(GateState.SERVO).run(8.0)
    assert gate.state is GateState.SERVO
    gate.changes = {"reached": False}
    gate.tick()
    assert (gate.state, gate.last.cause) == (GateState.ABORT, Cause.ERROR_NOT_FALLING)


def test_a_wrong_mounting_aborts_within_tolerance_as_well():
    gate = Rehearsal(auto_config(), changes={"reached": True}).until(GateState.SERVO).run(0.5)
    gate.look(reached=True, mounting_score=-6.0)
    assert (gate.state, gate.last.cause) == (GateState.ABORT, Cause.WRONG_MOUNTING)


def test_a_bad_report_is_no_observation():
    gate = Rehearsal(auto_config()).until(GateState.SERVO).run(0.3)
    gate.send([BadReport(gate.now_ns, "not JSON"), gate.report(mounting_score=-9.0)])
    assert gate.state is GateState.HOLD


# --- a route --------------------------------------------------------------------------------


def at_first_goal(**changes):
    """A gate in SERVO within tolerance of the first of two goals."""
    gate = Rehearsal(auto_config(), fall_m_s=0.0, error_m=0.02, **changes)
    gate.changes = {"goals_left": 1, "reached": True}
    return gate.until(GateState.SERVO)


def test_within_tolerance_of_a_goal_on_the_way_an_error_need_not_fall_and_nothing_is_reached():
    gate = at_first_goal(asked=(0.03, 0.0, 0.0, 0.0)).run(9.0)
    assert gate.state is GateState.SERVO
    gate.changes = {"goals_left": 1}
    gate.tick()
    assert (gate.state, gate.last.cause) == (GateState.ABORT, Cause.ERROR_NOT_FALLING)


def test_the_last_goal_is_reached_after_a_second_of_its_own():
    gate = at_first_goal().run(3.0)
    gate.changes["goals_left"] = 0
    gate.run(0.96)
    assert gate.state is GateState.SERVO
    gate.until(GateState.DONE, 0.1)


@pytest.mark.parametrize("asked", [(0.0, 0.0, 0.0, 0.0), (0.0, -0.05, 0.0, 0.0)])
@pytest.mark.parametrize("held", [False, True])
@pytest.mark.parametrize(("fall_m_s", "state"), [(0.1, "SERVO"), (0.0, "ABORT")])
def test_the_error_of_the_next_goal_is_not_compared_with_that_of_the_last(
    asked, held, fall_m_s, state
):
    gate = at_first_goal(asked=asked).run(8.0)
    if held:
        gate.send([gate.report(healthy=False)])
    gate.changes, gate.error_m, gate.fall_m_s = {}, 1.0, fall_m_s
    gate.asked = (0.4, 0.0, 0.0, 0.0)
    gate.run(4.0)
    assert gate.state is GateState(state)
    if state == "SERVO":
        assert speeds(gate)[-1] == pytest.approx(0.4)  # confirmed
    else:
        assert gate.last.cause is Cause.ERROR_NOT_FALLING
        assert max(speeds(gate)) <= 0.1 + 1e-12


def test_a_change_of_goal_adds_to_time_and_falls_and_begins_the_motion_anew():
    motion = Motion().run(5.02).see(errors(distance=(1.0, 0.985)))
    motion.check.change_goal(0, motion.now_ns)
    assert (motion.check.asked_m, motion.check.moved_m) == ((0.0, 0.0, 0.0),) * 2
    motion.see(errors(distance=(3.0, 2.985))).run(1.02)
    assert motion.check.followed_m == pytest.approx(0.1)
    assert motion.judge() is Response.CONFIRMED


def test_a_change_of_goal_begins_the_turn_anew():
    motion = Motion().run(5.02, TURN)
    motion.check.change_goal(0, motion.now_ns)
    assert motion.check.evaluate(motion.now_ns + S, TIMING) is Response.OPEN
    assert motion.check.followed_rad == 0.0
    assert motion.run(1.02, TURN).check.followed_rad == pytest.approx(0.2)
    assert motion.judge() is Response.FAILED
