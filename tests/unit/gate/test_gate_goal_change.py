"""Another goal, by the operator's order: only where nothing moves, and then from the beginning."""

import dataclasses

import pytest
from gate_rehearsal import Rehearsal, auto_config, pilot_config

from dfvs_core.gate.config import OnDone, S
from dfvs_core.gate.events import Action, VehicleMode
from dfvs_core.gate.states import Cause, GateState

GOAL = "ab" * 32


def at_goal(config=None):
    """A gate that has reached its goal, with an error that would be flown again."""
    gate = Rehearsal(config or auto_config()).until(GateState.SERVO)
    gate.changes = {"reached": True}
    gate.until(GateState.DONE)
    gate.changes, gate.error_m = {}, 1.0
    return gate


@pytest.mark.parametrize("state", [GateState.ENGAGE, GateState.SERVO])
def test_what_moves_or_is_about_to_keeps_its_goal(state):
    gate = Rehearsal(auto_config()).until(state)
    output = gate.command(Action.GOAL, GOAL)
    assert output.refusal == f"rejected: the goal cannot change in {state}, command hold first"
    assert gate.machine.perception.goal == ""
    assert gate.state is state


def test_a_vehicle_that_is_being_handed_over_keeps_its_goal():
    gate = at_goal(auto_config(on_done=OnDone.HOLD))
    assert gate.command(Action.GOAL, GOAL).refusal == (
        "rejected: the goal cannot change in DONE, send it again once the autopilot holds"
    )
    assert gate.machine.perception.goal == ""
    gate.run(1.5)
    assert gate.command(Action.GOAL, GOAL).refusal == ""


def test_a_ready_gate_goes_back_to_its_checks():
    gate = Rehearsal(pilot_config()).until(GateState.READY)
    gate.follows_goal = False
    assert gate.command(Action.GOAL, GOAL).refusal == ""
    assert gate.state is GateState.PREFLIGHT
    assert gate.last.cause is Cause.OPERATOR_GOAL
    gate.run(3.0)
    assert gate.state is GateState.PREFLIGHT
    assert "another goal" in gate.machine.reason
    gate.follows_goal = True
    gate.until(GateState.READY, 1.2)


def test_the_checks_ask_for_the_new_goals_overlap():
    gate = Rehearsal(pilot_config()).until(GateState.READY)
    gate.changes = {"overlap": 0.08}
    gate.command(Action.GOAL, GOAL)
    gate.run(3.0)
    assert gate.state is GateState.PREFLIGHT
    assert "overlap 8%" in gate.machine.reason


@pytest.mark.parametrize("flaw", [{"follows_goal": False}, {"changes": {"overlap": 0.08}}])
def test_from_the_goal_nothing_moves_until_the_next_one_is_seen(flaw):
    gate = at_goal()
    for name, value in flaw.items():
        setattr(gate, name, value)
    gate.command(Action.GOAL, GOAL)
    assert gate.state is GateState.HOLD
    gate.forget().run(2.5)
    assert gate.setpoints
    assert not gate.moved()
    gate.run(1.0)
    assert gate.state is GateState.ABORT
    assert gate.last.cause is Cause.HOLD_TOO_LONG


def test_from_the_goal_the_next_one_is_flown_with_an_initial_response_check():
    gate = at_goal()
    gate.command(Action.GOAL, GOAL)
    assert not gate.machine.has_reached
    gate.forget().until(GateState.SERVO, 1.2)
    gate.run(0.6)
    assert gate.moved()
    assert max(v.speed_m_s for _, v in gate.setpoints) <= 0.1 + 1e-9
    gate.run(2.0)
    assert max(v.speed_m_s for _, v in gate.setpoints) > 0.2


def test_waiting_at_the_goal_does_not_use_up_the_next_engagements_time():
    gate = at_goal(auto_config(max_engaged_ns=20 * S))
    gate.run(25.0)
    assert gate.state is GateState.DONE
    gate.command(Action.GOAL, GOAL)
    gate.until(GateState.SERVO).run(2.0)
    assert gate.state is GateState.SERVO


def test_a_new_goal_while_holding_waits_for_the_operator_who_ordered_to_hold():
    gate = Rehearsal(auto_config(), error_m=3.0).until(GateState.SERVO).run(3.0)
    assert max(v.speed_m_s for _, v in gate.setpoints) > 0.2  # its check has passed
    gate.command(Action.HOLD)
    assert gate.command(Action.GOAL, GOAL).refusal == ""
    gate.forget().run(5.0)
    assert gate.state is GateState.HOLD
    assert not gate.moved()
    gate.command(Action.ENGAGE)
    gate.until(GateState.SERVO, 1.2).run(0.5)
    assert max(v.speed_m_s for _, v in gate.setpoints) <= 0.1 + 1e-9


def test_a_commanded_hold_says_what_is_wrong_meanwhile_and_when_it_no_longer_is():
    gate = Rehearsal(auto_config()).until(GateState.SERVO)
    gate.command(Action.HOLD)
    gate.command(Action.GOAL, GOAL)
    gate.changes = {"healthy": False, "reason": "the new goal cannot be used"}
    gate.run(5.0)
    held = "operator commanded to hold"
    unusable = f"{held}; perception unhealthy: the new goal cannot be used"
    assert (gate.state, gate.machine.reason) == (GateState.HOLD, unusable)
    gate.changes = {}
    gate.run(0.1)
    assert (gate.state, gate.machine.reason) == (GateState.HOLD, held)
    gate.vehicle.parameters_told = False
    gate.run(31.0)
    assert gate.machine.reason.startswith(f"{held}; watch lost: ")


def test_a_hold_by_itself_and_a_held_engage_keep_their_reasons():
    gate = Rehearsal(auto_config()).until(GateState.SERVO)
    gate.sees = False
    gate.until(GateState.HOLD).run(1.0)
    assert gate.machine.reason == gate.last.reason
    gate = Rehearsal(auto_config()).until(GateState.ENGAGE)
    gate.command(Action.HOLD)
    gate.run(0.5)
    assert (gate.state, gate.machine.reason) == (GateState.ENGAGE, "armed and in the air")


def test_a_new_goal_while_holding_begins_the_time_to_hold_anew():
    gate = Rehearsal(auto_config()).until(GateState.SERVO)
    gate.sees = False
    gate.until(GateState.HOLD).run(2.5)
    gate.command(Action.GOAL, GOAL)
    gate.run(2.5)
    assert gate.state is GateState.HOLD
    gate.run(1.0)
    assert gate.state is GateState.ABORT


@pytest.mark.parametrize("mode", [VehicleMode.POSITION, VehicleMode.LAND])
def test_after_a_takeover_a_new_goal_moves_nothing_until_engaged_again(mode):
    gate = Rehearsal(auto_config()).until(GateState.SERVO)
    gate.beat(mode=mode)
    assert gate.state is GateState.RELEASED
    gate.forget()
    assert gate.command(Action.GOAL, GOAL).refusal == ""
    gate.run(3.0)
    assert gate.state is GateState.RELEASED
    assert not gate.setpoints
    assert gate.machine.perception.goal == GOAL


@pytest.mark.parametrize("end", ["handed over", "taken over", "stopped"])
def test_a_goal_that_is_not_flown_yet_is_not_reached(end):
    gate = at_goal(auto_config(on_done=OnDone.HOLD if end == "handed over" else OnDone.ZERO))
    if end == "taken over":
        gate.beat(mode=VehicleMode.POSITION)
    elif end == "stopped":
        gate.command(Action.ABORT)
    gate.run(2.0)
    assert gate.machine.is_finished
    assert gate.machine.has_reached
    assert gate.command(Action.GOAL, GOAL).refusal == ""
    assert not gate.machine.has_reached
    gate.command(Action.ENGAGE)
    gate.run(0.5)
    assert gate.state is GateState.PREFLIGHT
    assert not gate.machine.has_reached


def test_a_goal_that_is_refused_leaves_reached_what_it_was():
    gate = at_goal(auto_config(on_done=OnDone.HOLD))
    assert gate.command(Action.GOAL, GOAL).refusal
    assert gate.machine.has_reached


def test_a_goal_that_is_lost_counts_only_if_it_is_the_one_looked_for():
    gate = Rehearsal(auto_config()).until(GateState.SERVO)
    gate.command(Action.HOLD)
    gate.command(Action.GOAL, GOAL)
    old = gate.report(lost=True, healthy=False, reason="no progress", goal="")
    gate.send([old])
    assert gate.state is GateState.HOLD
    gate.send([dataclasses.replace(old, report=dataclasses.replace(old.report, goal=GOAL))])
    assert gate.state is GateState.ABORT
