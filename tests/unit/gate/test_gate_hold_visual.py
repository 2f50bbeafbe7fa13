"""Holding the goal by vision: DONE goes on to servo while data are good."""

import dataclasses
import itertools

import pytest
from gate_rehearsal import NO_CHECK, TICK_NS, Rehearsal, auto_config

from dfvs_core.gate.config import MS, GateTiming, OnDone, S
from dfvs_core.gate.events import Action, BadReport, ModeRequest, Stop, VehicleMode
from dfvs_core.gate.limits import ZERO
from dfvs_core.gate.states import Cause, GateState

GOAL = "ab" * 32
CONFIG = auto_config(on_done=OnDone.HOLD_VISUAL)
HOLDS = dataclasses.replace(NO_CHECK, on_done=OnDone.HOLD_VISUAL)
ZEROS = dataclasses.replace(NO_CHECK, on_done=OnDone.ZERO)


def at_goal(config=HOLDS, **changes):
    """A gate in DONE whose perception asks for a small velocity."""
    gate = Rehearsal(config, **changes).until(GateState.SERVO)
    gate.changes, gate.asked = {"reached": True}, (0.02, 0.01, 0.0, 0.0)
    gate.until(GateState.DONE)
    gate.changes = {}
    return gate


def test_the_goal_is_held_by_perceptions_velocity():
    gate = at_goal().forget().run(1.0)
    assert gate.state is GateState.DONE
    assert gate.machine.has_reached
    assert gate.setpoints[-1][1].forward_m_s == pytest.approx(0.02)
    gate.asked = (-0.03, 0.0, 0.01, 0.1)
    gate.run(1.0)
    last = gate.setpoints[-1][1]
    assert (last.forward_m_s, last.down_m_s, last.yaw_rad_s) == pytest.approx((-0.03, 0.01, 0.1))
    assert len(gate.setpoints) == 100
    assert not gate.requests


def test_it_goes_on_where_the_vehicle_drifts_out_of_tolerance():
    gate = at_goal()
    gate.changes = {"reached": False}
    gate.run(5.0)
    assert gate.state is GateState.DONE
    assert gate.setpoints[-1][1] != ZERO


def test_velocity_is_limited_and_slewed_as_in_servo():
    gate = at_goal().run(0.5).forget()
    gate.asked = (3.0, 0.0, 0.6, 0.0)
    gate.run(2.0)
    speeds = [v.speed_m_s for _, v in gate.setpoints]
    steps = [b - a for a, b in itertools.pairwise(speeds)]
    assert max(steps) <= 0.5 * 0.02 + 1e-9
    assert gate.setpoints[-1][1].forward_m_s == pytest.approx(0.5)


# --- data that are not good -----------------------------------------------------------------


def test_a_silent_perception_leads_to_hold_and_the_goal_is_reached_again():
    gate = at_goal().run(0.5)
    capture_ns = gate.machine.perception.last_capture_ns
    gate.sees = False
    gate.forget().until(GateState.HOLD)
    assert gate.last.cause is Cause.FRAME_OLD
    assert gate.setpoints[-1] == (gate.now_ns, ZERO)
    assert gate.now_ns - capture_ns <= 300 * MS
    gate.sees, gate.changes = True, {"reached": True}
    gate.until(GateState.DONE)
    targets = [t.target for t in gate.transitions]
    assert targets == [GateState.HOLD, GateState.SERVO, GateState.DONE]
    assert gate.run(0.5).setpoints[-1][1] != ZERO


@pytest.mark.parametrize("what", ["unhealthy", "garbage", "stall"])
def test_a_fault_of_perception_or_of_the_gate_stops_in_the_same_step(what):
    gate = at_goal().run(0.5)
    gate.now_ns += 151 * MS if what == "stall" else 5 * MS
    events = {
        "unhealthy": [gate.report(healthy=False)],
        "garbage": [BadReport(gate.now_ns, "not JSON")],
        "stall": [],
    }
    output = gate.send(events[what])
    assert output.setpoint == ZERO
    assert gate.state is GateState.HOLD


def test_data_that_stay_away_end_the_flight():
    gate = at_goal()
    gate.sees = False
    gate.until(GateState.ABORT, 3.5)
    assert gate.last.cause is Cause.HOLD_TOO_LONG


def test_a_lost_goal_aborts():
    gate = at_goal()
    output = gate.look(healthy=False, lost=True, reason="wrong goal")
    assert output.setpoint == ZERO
    assert (gate.state, gate.last.reason) == (GateState.ABORT, "goal lost: wrong goal")


def test_a_goal_lost_where_zeros_are_sent_changes_nothing():
    gate = at_goal(ZEROS)
    gate.send([gate.report(healthy=False, lost=True, reason="wrong goal")])
    assert gate.state is GateState.DONE


# --- caps -----------------------------------------------------------------------------------


def test_the_goal_is_held_for_its_time_and_the_autopilot_holds_after_it():
    gate = at_goal(dataclasses.replace(HOLDS, hold_visual_ns=20 * S, max_engaged_ns=10 * S))
    reached_ns = gate.now_ns
    gate.forget().until(GateState.ABORT, 25.0)
    assert gate.last.reason == "engaged too long: 20 s allowed"
    assert gate.now_ns == reached_ns + 20 * S + TICK_NS
    assert [r for _, r in gate.requests] == [ModeRequest.HOLD]
    assert gate.setpoints[-1][1] == ZERO


def test_a_hold_in_between_does_not_begin_that_time_anew():
    gate = at_goal(dataclasses.replace(HOLDS, hold_visual_ns=20 * S))
    reached_ns = gate.now_ns
    gate.run(10.0)
    gate.send([gate.report(healthy=False)])
    gate.changes = {"reached": True}
    gate.until(GateState.DONE)
    gate.until(GateState.ABORT, 12.0)
    assert gate.now_ns == reached_ns + 20 * S + TICK_NS


def test_too_far_from_the_start_aborts():
    gate = at_goal()
    x, y, z = gate.vehicle.position_m
    gate.vehicle.velocity_m_s = (2.0, 0.0, 0.0)
    for k in range(130):
        gate.vehicle.position_m = (x + 2.0 * k * TICK_NS / S, y, z)
        gate.tick()
    assert (gate.state, gate.last.cause) == (GateState.ABORT, Cause.DISTANCE_CAP)


# --- pilot, operator ------------------------------------------------------------------------


def test_a_takeover_silences_the_gate():
    gate = at_goal().forget()
    output = gate.beat(mode=VehicleMode.POSITION)
    assert (gate.state, output.setpoint) == (GateState.RELEASED, None)
    gate.run(3.0)
    assert not gate.setpoints
    assert not gate.requests


def test_a_stop_gives_the_vehicle_to_hold():
    gate = at_goal().run(0.5).forget()
    gate.send([Stop(gate.now_ns, "by SIGTERM")])
    assert gate.state is GateState.ABORT
    assert [r for _, r in gate.requests] == [ModeRequest.HOLD]
    assert not gate.moved()


def test_the_operator_holds_at_the_goal_and_engages_again():
    gate = at_goal().run(0.5)
    output = gate.command(Action.HOLD)
    assert (output.setpoint, output.refusal) == (ZERO, "")
    assert (gate.state, gate.last.cause) == (GateState.HOLD, Cause.OPERATOR_HOLD)
    gate.forget().run(10.0)
    assert gate.state is GateState.HOLD
    assert not gate.moved()
    gate.changes = {"reached": True}
    gate.command(Action.ENGAGE)
    gate.until(GateState.DONE)


@pytest.mark.parametrize("on_done", [OnDone.ZERO, OnDone.HOLD])
def test_a_command_to_hold_is_refused_where_nothing_moves_at_the_goal(on_done):
    gate = at_goal(dataclasses.replace(ZEROS, on_done=on_done))
    refusal = gate.command(Action.HOLD).refusal
    assert refusal == "rejected: nothing moves at the goal until another one is sent"
    assert gate.state is GateState.DONE


def test_a_command_to_hold_that_was_refused_at_the_goal_does_not_hold_the_next_flight():
    gate = at_goal(ZEROS)
    assert gate.command(Action.HOLD).refusal
    gate.follows_goal = True
    gate.command(Action.GOAL, GOAL)
    gate.until(GateState.SERVO, 1.2)


def test_another_goal_is_flown_as_a_new_engagement():
    gate = at_goal(dataclasses.replace(CONFIG, max_engaged_ns=20 * S)).run(15.0)
    gate.asked, gate.error_m = (0.4, 0.0, 0.0, 0.0), 1.0
    gate.command(Action.GOAL, GOAL)
    assert (gate.state, gate.last.cause) == (GateState.HOLD, Cause.OPERATOR_GOAL)
    assert not gate.machine.has_reached
    gate.forget().until(GateState.SERVO, 1.2).run(0.9)
    assert max(v.speed_m_s for _, v in gate.setpoints) <= 0.1 + 1e-12
    gate.run(10.0)
    assert gate.state is GateState.SERVO
    assert gate.setpoints[-1][1].speed_m_s == pytest.approx(0.4)


@pytest.mark.parametrize("is_ordered", [True, False])
def test_another_goal_in_a_hold_at_the_goal_is_a_new_engagement_as_well(is_ordered):
    """Its time is that of a flight, counted from here, and not the rest of the time at the goal."""
    config = dataclasses.replace(HOLDS, hold_visual_ns=4 * S, max_engaged_ns=15 * S)
    gate = at_goal(config)
    if is_ordered:
        gate.command(Action.HOLD)
    else:
        gate.send([gate.report(healthy=False)])
    gate.command(Action.GOAL, GOAL)
    ordered_ns = gate.now_ns
    assert gate.state is GateState.HOLD
    assert not gate.machine.has_reached
    if is_ordered:
        gate.run(2.0)
        assert gate.state is GateState.HOLD
        gate.command(Action.ENGAGE)
    gate.until(GateState.SERVO, 1.2)
    gate.until(GateState.ABORT, 16.0)
    assert gate.last.reason == "engaged too long: 15 s allowed"
    assert gate.now_ns == ordered_ns + 15 * S + TICK_NS


# --- initial-response check at the goal -----------------------------------------------------


def at_goal_from_the_start(**changes):
    """A gate whose goal was in tolerance before the initial-response check could pass."""
    gate = Rehearsal(CONFIG, fall_m_s=0.0, changes={"reached": True}, **changes)
    return gate.until(GateState.DONE)


def test_until_the_check_has_passed_the_goal_is_held_at_reduced_speed():
    gate = at_goal_from_the_start().forget()
    gate.run(0.5)
    assert max(v.speed_m_s for _, v in gate.setpoints) <= 0.1 + 1e-12
    gate.changes = {"reached": True, "mounting_score": 6.0}
    gate.run(2.0)
    assert gate.state is GateState.DONE
    assert max(v.speed_m_s for _, v in gate.setpoints) == pytest.approx(0.4)


def test_a_wrong_mounting_aborts_at_the_goal():
    gate = at_goal_from_the_start()
    gate.look(mounting_score=-6.0)
    assert (gate.state, gate.last.cause) == (GateState.ABORT, Cause.WRONG_MOUNTING)


def test_an_error_within_tolerance_need_not_fall_and_one_that_grows_out_of_it_aborts():
    gate = at_goal_from_the_start(asked=(0.05, 0.0, 0.0, 0.0)).run(20.0)
    assert gate.state is GateState.DONE
    gate.changes = {"reached": False}
    gate.until(GateState.ABORT, 0.1)
    assert gate.last.cause is Cause.ERROR_NOT_FALLING


def test_a_hold_at_the_goal_begins_the_check_anew():
    gate = at_goal_from_the_start(asked=(0.05, 0.0, 0.0, 0.0)).run(20.0)
    gate.send([gate.report(healthy=False)])
    gate.changes = {"reached": False}
    gate.until(GateState.SERVO)
    start_ns = gate.now_ns
    gate.until(GateState.ABORT)
    assert gate.last.cause is Cause.ERROR_NOT_FALLING
    assert gate.now_ns - start_ns == GateTiming().response_limit_ns


def test_where_zeros_are_sent_the_check_ends_with_the_flight():
    config = auto_config(on_done=OnDone.ZERO)
    gate = Rehearsal(config, fall_m_s=0.0, changes={"reached": True}).until(GateState.DONE)
    gate.changes = {"mounting_score": -9.0}
    gate.forget().run(10.0)
    assert gate.state is GateState.DONE
    assert not gate.moved()
