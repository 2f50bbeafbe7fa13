"""What small changes of the code would change: limits met exactly, signs, what is forgotten."""

import math

import pytest
from gate_rehearsal import TICK_NS, Rehearsal, auto_config, pilot_config

from dfvs_core.gate.checks.perception_monitor import PerceptionMonitor
from dfvs_core.gate.config import MS, Engage, GateTiming, OnDone
from dfvs_core.gate.events import (
    Action,
    LocalPosition,
    ModeRequest,
    OperatorCommand,
    Stop,
    VehicleMode,
)
from dfvs_core.gate.limits import ZERO
from dfvs_core.gate.states import Cause, GateState
from dfvs_core.gate.vehicle import VehicleMonitor

TIMING = GateTiming()


# --- sight, vehicle, others -----------------------------------------------------------------


def test_without_a_good_report_there_is_no_goal_reached_and_no_velocity():
    sight = PerceptionMonitor(TIMING)
    assert (sight.reached_for_ns(5), sight.velocity()) == (-1, ZERO)
    report = Rehearsal().report(reached=True, t_capture_ns=9 * MS).report
    sight.update(report, 10 * MS)
    assert sight.reached_for_ns(10 * MS) == 0
    sight.invalidate((Cause.GATE_STALLED, ""))
    assert (sight.reached_for_ns(11 * MS), sight.velocity()) == (-1, ZERO)


def test_a_position_that_is_no_number_is_an_endless_jump():
    vehicle = VehicleMonitor()
    for t_ns, north_m in ((1, 0.0), (2, math.nan)):
        vehicle.update(LocalPosition(t_ns, (north_m, 0.0, 0.0), (0.0, 0.0, 0.0)))
    assert vehicle.jump_m == math.inf


# --- orders ---------------------------------------------------------------------------------


def test_an_order_to_engage_does_not_lengthen_a_hold_that_nobody_ordered():
    gate = Rehearsal().until(GateState.SERVO)
    gate.sees = False
    gate.until(GateState.HOLD).run(2.5)
    gate.send([OperatorCommand(gate.now_ns, Action.ENGAGE)])
    gate.until(GateState.ABORT, 0.6)


def test_a_goal_that_comes_after_an_abort_engages_nobody():
    gate = Rehearsal().until(GateState.SERVO)
    gate.vehicle.obeys = False
    gate.send([Stop(gate.now_ns, "")])
    assert not gate.machine.stream.is_silent
    output = gate.send([OperatorCommand(gate.now_ns, Action.GOAL, "ab" * 32)])
    assert (gate.state, output.transitions) == (GateState.ABORT, ())


def test_a_goal_that_comes_after_the_vehicle_was_handed_over_engages_nobody():
    gate = Rehearsal(auto_config(on_done=OnDone.HOLD), changes={"reached": True})
    gate.until(GateState.DONE).run(1.5)
    assert gate.machine.stream.is_silent
    gate.send([OperatorCommand(gate.now_ns, Action.GOAL, "ab" * 32)])
    assert gate.state is GateState.DONE


def test_a_goal_is_logged_by_the_first_twelve_of_its_digits():
    gate = Rehearsal(pilot_config()).until(GateState.READY)
    gate.send([OperatorCommand(gate.now_ns, Action.GOAL, "0123456789abcdef" * 4)])
    assert (gate.last.cause, gate.last.detail) == (Cause.OPERATOR_GOAL, "0123456789ab")


@pytest.mark.parametrize(("late_ns", "engages"), [(0, True), (1, False)])
def test_an_order_to_engage_counts_for_exactly_five_seconds(late_ns, engages):
    gate = Rehearsal(auto_config(engage=Engage.COMMAND)).until(GateState.READY)
    gate.vehicle.in_air = False
    gate.command(Action.ENGAGE)
    ordered_ns = gate.now_ns
    gate.run(4.9)
    assert gate.state is GateState.READY
    gate.vehicle.in_air = True
    gate.now_ns = ordered_ns + TIMING.command_valid_ns + late_ns
    gate.send(gate.nominal())
    assert (gate.state is GateState.ENGAGE) is engages


# --- times ----------------------------------------------------------------------------------


def test_the_pilots_offboard_leads_to_servo_after_exactly_a_second():
    gate = Rehearsal(pilot_config()).until(GateState.READY)
    gate.beat(mode=VehicleMode.OFFBOARD)
    engaged_ns = gate.last.t_ns
    gate.vehicle.sends_heartbeat = False  # the one that showed OFFBOARD is enough
    gate.now_ns = engaged_ns + TIMING.engage_zero_ns - TICK_NS
    gate.send(gate.nominal())
    assert gate.state is GateState.ENGAGE
    gate.tick()
    assert (gate.state, gate.last.t_ns) == (GateState.SERVO, engaged_ns + TIMING.engage_zero_ns)


def test_the_goal_is_reached_after_exactly_a_second_in_tolerance():
    gate = Rehearsal(changes={"reached": True}).until(GateState.DONE)
    servo, done = gate.transitions[-2:]
    assert (servo.target, done.t_ns - servo.t_ns) == (GateState.SERVO, TIMING.reached_ns)


def test_engaging_without_good_data_never_passes_through_servo():
    gate = Rehearsal(pilot_config()).until(GateState.READY)
    gate.sees = False
    gate.run(0.3)
    gate.beat(mode=VehicleMode.OFFBOARD)
    gate.until(GateState.HOLD, 1.2)
    assert GateState.SERVO not in [t.target for t in gate.transitions]


@pytest.mark.parametrize(("age_ns", "asks"), [(0, True), (1, False)])
def test_hold_is_asked_for_by_a_heartbeat_that_still_counts(age_ns, asks):
    gate = Rehearsal().until(GateState.SERVO)
    beat_ns = gate.machine.vehicle.heartbeat.t_ns
    gate.vehicle.sends_heartbeat = False
    while gate.now_ns < beat_ns + TIMING.mode_known_ns - TICK_NS:
        gate.tick()
    gate.now_ns = beat_ns + TIMING.mode_known_ns + age_ns
    output = gate.send([Stop(gate.now_ns, "")])
    assert output.mode_request is (ModeRequest.HOLD if asks else None)


@pytest.mark.parametrize(("age_ns", "asks"), [(0, True), (1, False)])
@pytest.mark.parametrize("silent", [("attitude",), ("position",), ("attitude", "position")])
def test_hold_is_asked_for_while_the_link_would_tell_a_change_of_mode(silent, age_ns, asks):
    gate = Rehearsal().until(GateState.SERVO)
    for name in silent:
        setattr(gate.vehicle, f"sends_{name}", False)
    heard_ns = gate.now_ns
    gate.run(0.18)
    gate.now_ns = heard_ns + TIMING.link_silent_ns + age_ns
    output = gate.send([Stop(gate.now_ns, "")])
    one_is_heard = len(silent) == 1
    assert output.mode_request is (ModeRequest.HOLD if asks or one_is_heard else None)


def test_a_gate_that_was_told_to_stop_takes_no_order_to_engage():
    """In one step with the stop, and after a takeover that the stop finds ended already."""
    gate = Rehearsal(pilot_config()).until(GateState.READY)
    gate.vehicle.mode = VehicleMode.HOLD
    gate.send([Stop(gate.now_ns, "by SIGTERM"), OperatorCommand(gate.now_ns, Action.ENGAGE)])
    assert gate.state is GateState.ABORT
    gate.run(3.0)
    assert gate.machine.is_finished
    output = gate.command(Action.ENGAGE)
    assert (gate.state, output.refusal) == (GateState.ABORT, "rejected: the service is being ended")


def test_a_stop_after_a_takeover_is_not_overruled():
    gate = Rehearsal().until(GateState.SERVO)
    gate.beat(mode=VehicleMode.POSITION)
    assert gate.state is GateState.RELEASED
    gate.tick(Stop(gate.now_ns, "by SIGTERM"), OperatorCommand(gate.now_ns, Action.ENGAGE))
    gate.run(3.0)
    assert gate.state is GateState.RELEASED
    assert gate.machine.is_finished


def test_an_order_to_engage_at_the_goal_is_refused_with_what_to_do():
    gate = Rehearsal()
    gate.changes["reached"] = True
    gate.until(GateState.DONE)
    output = gate.command(Action.ENGAGE)
    assert output.refusal == "rejected: the goal is reached, send another goal"
    assert gate.state is GateState.DONE


@pytest.mark.parametrize(
    ("unsupervised", "reason"),
    [(False, "service stops: by SIGTERM"), (True, "parent process silent: by SIGTERM")],
)
def test_a_stop_says_whose_it_is(unsupervised, reason):
    gate = Rehearsal().until(GateState.SERVO)
    gate.send([Stop(gate.now_ns, "by SIGTERM", unsupervised)])
    assert (gate.state, gate.machine.reason) == (GateState.ABORT, reason)


def test_the_reasons_of_holds_and_of_disarming_word_by_word():
    gate = Rehearsal().until(GateState.ENGAGE)
    gate.command(Action.HOLD)
    gate.until(GateState.HOLD)
    assert gate.machine.reason == "operator commanded to hold"
    assert not gate.moved()
    gate.command(Action.ENGAGE)
    gate.until(GateState.SERVO)
    assert gate.machine.reason == "good data"
    gate.beat(armed=False)
    assert (gate.state, gate.machine.reason) == (GateState.RELEASED, "vehicle disarmed")
