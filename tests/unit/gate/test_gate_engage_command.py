"""What an operator's commands do before a flight: those that engage, and those that do nothing."""

import pytest
from gate_rehearsal import Rehearsal, auto_config, pilot_config

from dfvs_core.gate.config import Engage
from dfvs_core.gate.events import Action, VehicleMode
from dfvs_core.gate.states import Cause, GateState

COMMAND = auto_config(engage=Engage.COMMAND)


def test_command_waits_for_the_operator():
    gate = Rehearsal(COMMAND).until(GateState.READY).run(5.0)
    assert gate.state is GateState.READY
    gate.command(Action.ENGAGE)
    assert (gate.state, gate.last.cause) == (GateState.ENGAGE, Cause.COMMAND_ENGAGED)
    gate.until(GateState.SERVO)


def test_an_order_during_preflight_counts():
    gate = Rehearsal(COMMAND).until(GateState.PREFLIGHT)
    gate.command(Action.ENGAGE)
    gate.until(GateState.ENGAGE)


def test_an_order_to_hold_takes_back_the_order_to_engage():
    gate = Rehearsal(COMMAND).until(GateState.PREFLIGHT)
    gate.command(Action.ENGAGE)
    gate.command(Action.HOLD)
    gate.run(5.0)
    assert gate.state is GateState.READY


@pytest.mark.parametrize("by", list(Engage))
@pytest.mark.parametrize("state", [GateState.PREFLIGHT, GateState.READY])
def test_a_command_to_hold_is_refused_where_nothing_is_flown_yet(state, by):
    gate = Rehearsal(pilot_config(engage=by))
    gate.vehicle.mode = VehicleMode.TAKEOFF
    output = gate.until(state).command(Action.HOLD)
    assert output.refusal == "rejected: nothing is flown yet, command abort to end this"
    assert gate.state is state


def test_a_command_to_hold_is_refused_before_a_vehicle_is_received():
    gate = Rehearsal()
    gate.vehicle.sends_heartbeat = False
    output = gate.command(Action.HOLD)
    assert output.refusal == "rejected: nothing is flown yet, command abort to end this"
    assert gate.state is GateState.IDLE


@pytest.mark.parametrize("wait_s", [0.1, 5.1])
def test_a_command_to_hold_takes_back_a_command_to_engage_that_still_counts(wait_s):
    gate = Rehearsal(COMMAND)
    gate.vehicle.mode = VehicleMode.TAKEOFF
    gate.until(GateState.READY)
    gate.command(Action.ENGAGE)
    gate.run(wait_s)
    is_refused = bool(gate.command(Action.HOLD).refusal)
    assert is_refused is (wait_s > 5.0)
    assert gate.command(Action.HOLD).refusal


def test_a_command_to_hold_is_refused_after_the_flight():
    gate = Rehearsal(COMMAND)
    gate.until(GateState.READY).command(Action.ENGAGE)
    gate.until(GateState.SERVO)
    assert gate.command(Action.HOLD).refusal == ""
    gate.command(Action.ABORT)
    assert gate.command(Action.HOLD).refusal == "rejected: the flight is ended already"
    gate.run(3.0)
    assert gate.command(Action.HOLD).refusal == "rejected: the flight is ended already"


def test_a_command_to_hold_is_refused_after_a_takeover():
    gate = Rehearsal().until(GateState.SERVO)
    gate.beat(mode=VehicleMode.POSITION)
    assert gate.command(Action.HOLD).refusal == "rejected: the vehicle is not flown any more"
    assert gate.state is GateState.RELEASED


@pytest.mark.parametrize("mode", [VehicleMode.TAKEOFF, VehicleMode.LAND, VehicleMode.MANUAL])
def test_an_order_does_not_take_the_vehicle_out_of_just_any_mode(mode):
    gate = Rehearsal(COMMAND)
    gate.vehicle.mode = mode
    gate.until(GateState.READY)
    gate.command(Action.ENGAGE)
    gate.run(1.0)
    assert gate.state is GateState.READY


def waiting_for_engage(mode=VehicleMode.ALTITUDE):
    gate = Rehearsal(COMMAND)
    gate.vehicle.mode = mode
    gate.until(GateState.READY)
    gate.command(Action.ENGAGE)
    return gate


def test_a_command_to_engage_says_what_it_waits_for():
    gate = waiting_for_engage()
    waits = "engage waits for Hold or Position in the air; the vehicle"
    assert gate.machine.reason == f"{waits} is in ALTITUDE, flying"
    gate.vehicle.in_air = False
    gate.tick()
    gate.tell_mode(VehicleMode.POSITION)
    assert gate.machine.reason == f"{waits} is in POSITION, not flying"
    assert gate.state is GateState.READY


def test_a_command_to_engage_that_waits_for_a_check_names_it():
    gate = waiting_for_engage()
    gate.changes = {"overlap": 0.08}
    gate.run(0.1)
    waits = "engage waits for goal: overlap 8%, 9% needed"
    assert gate.machine.reason == waits
    gate.changes |= {"reason": "goal 2 of the route's 3"}
    gate.run(0.1)
    assert gate.machine.reason == f"{waits} (goal 2 of the route's 3)"


def test_a_command_to_engage_that_has_expired_says_so_until_it_is_commanded_again():
    gate = waiting_for_engage().run(5.1)
    expired = "engage has expired after 5 s, command it again in Hold or Position in the air"
    assert gate.machine.reason == expired
    gate.tell_mode(VehicleMode.HOLD)
    gate.run(1.0)
    assert (gate.state, gate.machine.reason) == (GateState.READY, expired)
    gate.command(Action.ENGAGE)
    assert gate.state is GateState.ENGAGE


def test_nothing_waits_once_a_command_to_engage_is_taken_back():
    gate = waiting_for_engage()
    gate.command(Action.HOLD)
    assert gate.machine.reason == "checks passed"


@pytest.mark.parametrize("by", [Engage.PILOT, Engage.AUTO])
def test_after_another_engage_nothing_waits_for_a_command(by):
    gate = Rehearsal(auto_config(engage=by))
    gate.vehicle.mode = VehicleMode.ALTITUDE
    gate.until(GateState.READY)
    gate.command(Action.ABORT)
    gate.run(3.0)
    gate.command(Action.ENGAGE)
    gate.until(GateState.READY).run(0.1)
    assert gate.machine.reason == "checks passed"


@pytest.mark.parametrize("state", [GateState.PREFLIGHT, GateState.READY])
@pytest.mark.parametrize(
    ("by", "reason"),
    [
        (Engage.PILOT, "gate.engage is pilot: the pilot selects OFFBOARD"),
        (Engage.AUTO, "gate.engage is auto: it engages once the vehicle flies in Hold"),
        (Engage.NEVER, "gate.engage is never: nothing is flown"),
    ],
)
def test_where_no_command_engages_it_is_refused_with_the_setting(by, reason, state):
    gate = Rehearsal(pilot_config(engage=by))
    gate.vehicle.mode = VehicleMode.POSITION
    gate.until(state)
    assert gate.command(Action.ENGAGE).refusal == f"rejected: {reason}"


@pytest.mark.parametrize("state", [GateState.PREFLIGHT, GateState.READY])
def test_a_command_that_engages_is_accepted(state):
    assert Rehearsal(COMMAND).until(state).command(Action.ENGAGE).refusal == ""


def test_before_a_vehicle_is_heard_a_command_to_engage_is_refused():
    gate = Rehearsal(COMMAND)
    gate.vehicle.sends_heartbeat = False
    assert gate.command(Action.ENGAGE).refusal == "rejected: no vehicle heard"


@pytest.mark.parametrize("state", [GateState.ENGAGE, GateState.SERVO, GateState.HOLD])
def test_an_engaged_gate_refuses_to_engage_again(state):
    gate = Rehearsal()
    if state is GateState.HOLD:
        gate.until(GateState.SERVO)
        gate.sees = False
    assert gate.until(state).command(Action.ENGAGE).refusal == "rejected: already engaged"
    assert gate.state is state


def test_a_commanded_hold_is_lifted_once():
    gate = Rehearsal().until(GateState.SERVO)
    gate.command(Action.HOLD)
    assert gate.command(Action.ENGAGE).refusal == ""
    assert gate.command(Action.ENGAGE).refusal == "rejected: already engaged"


@pytest.mark.parametrize("by", list(Engage))
def test_after_its_end_a_flight_is_left_by_a_command_in_any_case(by):
    gate = Rehearsal(pilot_config(engage=by)).until(GateState.READY)
    gate.command(Action.ABORT)
    gate.run(2.0)
    assert gate.command(Action.ENGAGE).refusal == ""
    assert gate.last.cause is Cause.OPERATOR_AGAIN
