"""CURRENT_MODE tells of a change of mode long before the next heartbeat does."""

import pytest
from gate_rehearsal import Rehearsal, auto_config, pilot_config

from dfvs_core.gate.config import MS, S
from dfvs_core.gate.events import CurrentMode, Heartbeat, ModeRequest, VehicleMode
from dfvs_core.gate.states import Cause, GateState
from dfvs_core.gate.vehicle import VehicleMonitor


def test_the_pilots_switch_engages_at_once():
    gate = Rehearsal(pilot_config()).until(GateState.READY)
    gate.tell_mode(VehicleMode.OFFBOARD)
    assert (gate.state, gate.last.cause) == (GateState.ENGAGE, Cause.PILOT_ENGAGED)
    start_ns = gate.now_ns
    gate.until(GateState.SERVO)
    assert gate.now_ns - start_ns >= 1 * S


def test_it_confirms_the_offboard_that_was_asked_for():
    gate = Rehearsal(auto_config()).until(GateState.ENGAGE)
    gate.vehicle.sends_heartbeat = False
    gate.run(1.1)
    assert [r for _, r in gate.requests] == [ModeRequest.OFFBOARD]
    assert gate.state is GateState.ENGAGE
    gate.tell_mode(VehicleMode.OFFBOARD)
    assert (gate.state, gate.last.cause) == (GateState.SERVO, Cause.OFFBOARD_CONFIRMED)


@pytest.mark.parametrize("mode", sorted(set(VehicleMode) - {VehicleMode.OFFBOARD}))
def test_a_takeover_silences_the_gate_without_waiting_for_a_heartbeat(mode):
    gate = Rehearsal(pilot_config()).until(GateState.READY)
    gate.tell_mode(VehicleMode.OFFBOARD)
    gate.until(GateState.SERVO).run(0.3).forget()
    output = gate.tell_mode(mode)
    assert (gate.state, gate.last.cause) == (GateState.RELEASED, Cause.TAKEOVER)
    assert output.setpoint is None
    gate.run(3.0)
    assert not gate.setpoints
    assert not gate.requests


def test_the_pilots_hold_after_a_cancelled_flight_ends_the_stream():
    gate = Rehearsal(pilot_config()).until(GateState.READY)
    gate.vehicle.obeys = False
    gate.tell_mode(VehicleMode.OFFBOARD)
    gate.until(GateState.SERVO)
    gate.vehicle.battery = 0.1
    gate.until(GateState.ABORT)
    assert gate.tick().setpoint is not None
    assert gate.tell_mode(VehicleMode.HOLD).setpoint is None


def test_before_any_heartbeat_it_starts_nothing():
    gate = Rehearsal()
    gate.vehicle.sends_heartbeat = False
    gate.tell_mode(VehicleMode.OFFBOARD)
    gate.run(3.0)
    assert gate.state is GateState.IDLE
    gate.beat(mode=VehicleMode.HOLD)
    assert (gate.state, gate.last.cause) == (GateState.PREFLIGHT, Cause.HEARTBEAT_RECEIVED)


def test_it_is_no_heartbeat():
    """An autopilot whose heartbeats stop is lost, whatever else it tells."""
    gate = Rehearsal(pilot_config()).until(GateState.READY)
    gate.tell_mode(VehicleMode.OFFBOARD)
    gate.until(GateState.SERVO)
    gate.vehicle.sends_heartbeat = False
    for _ in range(25):
        gate.run(0.1)
        gate.tell_mode(VehicleMode.OFFBOARD)
    assert gate.last.cause is Cause.HEARTBEAT_LOST


def test_it_changes_nothing_but_the_mode():
    vehicle = VehicleMonitor()
    vehicle.update(Heartbeat(5 * MS, VehicleMode.POSITION, armed=True, failsafe=True))
    vehicle.update(CurrentMode(9 * MS, VehicleMode.OFFBOARD))
    assert vehicle.heartbeat == Heartbeat(5 * MS, VehicleMode.OFFBOARD, armed=True, failsafe=True)
    assert vehicle.is_offboard
    vehicle.update(Heartbeat(12 * MS, VehicleMode.HOLD, armed=False))
    assert vehicle.heartbeat == Heartbeat(12 * MS, VehicleMode.HOLD, armed=False)
