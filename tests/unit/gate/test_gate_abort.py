"""What ends a flight: faults, lost data, a takeover."""

import math

import pytest
from gate_rehearsal import (
    NO_CHECK,
    TICK_NS,
    Rehearsal,
    auto_config,
    flying,
    in_confirmed,
    pilot_config,
)

from dfvs_core.gate.config import MS, S
from dfvs_core.gate.events import (
    Action,
    EstimatorState,
    Heartbeat,
    ModeRequest,
    OperatorCommand,
    Stop,
    VehicleMode,
)
from dfvs_core.gate.limits import ZERO
from dfvs_core.gate.states import Cause, GateState


@pytest.mark.parametrize(
    ("attribute", "value", "cause", "within_ns"),
    [
        ("sends_heartbeat", False, Cause.HEARTBEAT_LOST, 3 * S),
        ("sends_attitude", False, Cause.TELEMETRY_LOST, 600 * MS),
        ("sends_status", False, Cause.TELEMETRY_LOST, 2100 * MS),
        ("sends_position", False, Cause.TELEMETRY_LOST, 600 * MS),
        ("battery", 0.1, Cause.BATTERY_LOW, 20 * MS),
        ("battery", None, Cause.BATTERY_LOW, 20 * MS),
        ("roll_rad", math.nan, Cause.ESTIMATOR_INVALID, 20 * MS),
        ("position_m", (1.0, math.nan, -3.0), Cause.ESTIMATOR_INVALID, 20 * MS),
        ("position_m", (1.0, 2.6, -3.0), Cause.ESTIMATOR_JUMP, 20 * MS),
        ("in_air", False, Cause.LANDED, 20 * MS),
        ("failsafe", True, Cause.FAILSAFE, 1 * S),
    ],
)
@pytest.mark.parametrize("state", [GateState.ENGAGE, GateState.SERVO, GateState.HOLD])
def test_a_fault_of_the_vehicle_aborts(state, attribute, value, cause, within_ns):
    gate = Rehearsal(NO_CHECK)
    if state is GateState.HOLD:
        gate.until(GateState.SERVO).send([gate.report(healthy=False)])
    gate.until(state)
    setattr(gate.vehicle, attribute, value)
    start_ns = gate.now_ns
    if cause is Cause.HEARTBEAT_LOST:
        # Two seconds without a heartbeat are more than ENGAGE and HOLD last by themselves.
        gate.run(0.02)
        gate.now_ns += 1
        gate.send([Heartbeat(gate.now_ns - 2 * S, VehicleMode.OFFBOARD, armed=True)])
    elif cause is Cause.FAILSAFE:
        gate.beat(mode=gate.vehicle.mode)
    gate.until(GateState.ABORT)
    assert gate.last.cause is cause
    assert gate.now_ns - start_ns <= within_ns + 20 * MS
    assert gate.setpoints[-1][1] == ZERO


def test_an_estimator_that_calls_itself_invalid_aborts():
    gate = flying()
    gate.send([EstimatorState(gate.now_ns, valid=False, detail="no attitude")])
    assert gate.last.reason == "estimator invalid: no attitude"
    assert gate.state is GateState.ABORT


def test_a_lost_goal_aborts_with_perceptions_reason():
    gate = flying()
    gate.send([gate.report(healthy=False, lost=True, reason="no progress")])
    assert gate.state is GateState.ABORT
    assert gate.last.reason == "goal lost: no progress"


def test_too_far_from_the_start_aborts():
    gate = flying()
    gate.vehicle.velocity_m_s = (2.0, 0.0, 0.0)
    x, y, z = gate.vehicle.position_m
    for k in range(200):
        gate.vehicle.position_m = (x + 2.0 * k * TICK_NS / S, y, z)
        gate.tick()
        if gate.state is not GateState.SERVO:
            break
    assert gate.last.cause is Cause.DISTANCE_CAP
    assert 5.0 < gate.machine.distance_m < 5.1


def test_before_the_first_engagement_no_distance_from_its_start_is_known():
    gate = Rehearsal(auto_config()).until(GateState.READY)
    assert math.isnan(gate.machine.distance_m)
    assert gate.until(GateState.SERVO).machine.distance_m < 0.1


def test_too_long_engaged_aborts():
    gate = Rehearsal(auto_config(max_engaged_ns=10 * S)).until(GateState.ENGAGE)
    start_ns = gate.now_ns
    gate.until(GateState.ABORT)
    assert gate.last.cause is Cause.TIME_CAP
    assert gate.now_ns - start_ns <= 10 * S + TICK_NS


def test_abort_asks_for_hold_once_and_then_falls_silent():
    gate = flying()
    gate.vehicle.obeys = False
    gate.forget().send([Stop(gate.now_ns, "by SIGTERM")])
    assert gate.state is GateState.ABORT
    assert gate.setpoints == [(gate.now_ns, ZERO)]
    assert gate.requests == [(gate.now_ns, ModeRequest.HOLD)]
    start_ns = gate.now_ns
    gate.run(10.0)
    assert len(gate.requests) == 1
    assert gate.setpoints[-1][0] - start_ns == 1500 * MS
    assert not gate.moved()
    assert gate.machine.is_finished


def test_abort_falls_silent_as_soon_as_the_heartbeat_shows_hold():
    gate = flying()
    gate.send([Stop(gate.now_ns, "by SIGTERM")])
    gate.run(0.1)
    gate.beat(mode=VehicleMode.HOLD)
    gate.forget().run(5.0)
    assert not gate.setpoints


def test_abort_with_a_heartbeat_too_old_to_tell_the_mode_asks_for_nothing():
    gate = flying()
    gate.vehicle.sends_heartbeat = False
    gate.forget().until(GateState.ABORT)
    assert gate.last.cause is Cause.HEARTBEAT_LOST
    gate.run(5.0)
    assert not gate.requests
    assert gate.machine.is_finished


def test_abort_before_anything_was_streamed_sends_nothing():
    gate = Rehearsal()
    gate.vehicle.in_air = False
    gate.until(GateState.READY)
    gate.send([Stop(gate.now_ns, "by SIGTERM")])
    assert gate.state is GateState.ABORT
    assert gate.machine.is_finished
    assert not gate.setpoints
    assert not gate.requests


def test_abort_in_ready_returns_to_hold_a_vehicle_that_was_just_switched():
    gate = Rehearsal(pilot_config()).until(GateState.READY)
    gate.send([Stop(gate.now_ns, "", unsupervised=True)])
    assert gate.last.cause is Cause.UNSUPERVISED
    assert not gate.requests
    gate.run(0.2)
    gate.beat(mode=VehicleMode.OFFBOARD)
    assert [r for _, r in gate.requests] == [ModeRequest.HOLD]


# --- takeover ---------------------------------------------------------------------------


@pytest.mark.parametrize(
    "state", [GateState.ENGAGE, GateState.SERVO, GateState.HOLD, GateState.DONE]
)
@pytest.mark.parametrize("mode", sorted(set(VehicleMode) - {VehicleMode.OFFBOARD}))
def test_a_takeover_silences_the_gate_in_the_same_step(state, mode):
    gate = in_confirmed(state)
    gate.forget()
    output = gate.beat(mode=mode)
    assert (gate.state, gate.last.cause) == (GateState.RELEASED, Cause.TAKEOVER)
    assert output.setpoint is None
    gate.vehicle.obeys = False
    gate.run(5.0)
    gate.beat(mode=VehicleMode.OFFBOARD)
    gate.run(5.0)
    gate.send([Stop(gate.now_ns, "by SIGTERM"), OperatorCommand(gate.now_ns, Action.ABORT)])
    assert gate.state is GateState.RELEASED
    assert not gate.setpoints
    assert not gate.requests


def test_offboard_again_in_the_next_message_does_not_undo_a_takeover():
    gate = in_confirmed(GateState.SERVO)
    away = Heartbeat(gate.now_ns, VehicleMode.POSITION, armed=True)
    back = Heartbeat(gate.now_ns, VehicleMode.OFFBOARD, armed=True)
    output = gate.send([away, back, gate.report()])
    assert gate.state is GateState.RELEASED
    assert output.setpoint is None


@pytest.mark.parametrize(
    "state", [GateState.ENGAGE, GateState.SERVO, GateState.HOLD, GateState.DONE]
)
def test_disarming_releases(state):
    gate = in_confirmed(state)
    output = gate.beat(armed=False)
    assert (gate.state, gate.last.cause) == (GateState.RELEASED, Cause.DISARMED)
    assert output.setpoint is None


def test_the_takeover_wins_over_a_fault_of_the_same_step():
    gate = in_confirmed(GateState.SERVO)
    gate.vehicle.failsafe = True
    gate.forget().beat(mode=VehicleMode.RETURN)
    assert gate.state is GateState.RELEASED
    assert not gate.requests
