"""What an operator's commands do in flight."""

import dataclasses

import pytest
from gate_rehearsal import NO_CHECK, Rehearsal, in_confirmed

from dfvs_core.gate.config import Engage
from dfvs_core.gate.events import (
    Action,
    ModeRequest,
    OperatorCommand,
    VehicleMode,
)
from dfvs_core.gate.states import GateState


@pytest.mark.parametrize("state", [GateState.RELEASED, GateState.ABORT])
def test_the_operator_may_engage_again(state):
    gate = in_confirmed(GateState.SERVO)
    if state is GateState.RELEASED:
        gate.beat(mode=VehicleMode.HOLD)
    else:
        gate.send([OperatorCommand(gate.now_ns, Action.ABORT)])
        gate.run(1.0)
    assert gate.state is state
    gate.forget().send([OperatorCommand(gate.now_ns, Action.ENGAGE)])
    assert (gate.state, gate.last.reason) == (GateState.PREFLIGHT, "operator engages again")
    assert not gate.setpoints
    gate.until(GateState.READY)
    gate.beat(mode=VehicleMode.OFFBOARD)
    gate.until(GateState.SERVO)


def test_one_order_engages_again_where_orders_engage():
    config = dataclasses.replace(NO_CHECK, engage=Engage.COMMAND)
    gate = Rehearsal(config).until(GateState.READY)
    gate.command(Action.ENGAGE)
    gate.until(GateState.SERVO)
    gate.changes = {"reached": True}
    gate.until(GateState.DONE)
    gate.beat(mode=VehicleMode.HOLD)
    assert gate.machine.has_reached
    gate.run(0.2)
    gate.command(Action.ENGAGE)
    gate.until(GateState.ENGAGE)
    assert not gate.machine.has_reached


def test_engaging_again_must_wait_until_the_abort_is_over():
    gate = in_confirmed(GateState.SERVO)
    gate.vehicle.obeys = False
    orders = [OperatorCommand(gate.now_ns, action) for action in (Action.ABORT, Action.ENGAGE)]
    output = gate.send(orders)
    assert gate.state is GateState.ABORT
    assert output.refusal == "rejected: the flight is still being ended, command it again"


def test_the_operator_holds_and_engages_again():
    gate = in_confirmed(GateState.SERVO)
    gate.send([OperatorCommand(gate.now_ns, Action.HOLD)])
    assert (gate.state, gate.last.reason) == (GateState.HOLD, "operator commanded to hold")
    gate.run(20.0)
    assert gate.state is GateState.HOLD
    gate.send([OperatorCommand(gate.now_ns, Action.ENGAGE)])
    gate.until(GateState.SERVO, 0.1)


def test_a_held_gate_that_is_engaged_again_without_data_aborts_after_three_seconds():
    gate = in_confirmed(GateState.SERVO)
    gate.send([OperatorCommand(gate.now_ns, Action.HOLD)])
    gate.sees = False
    gate.run(10.0)
    assert gate.state is GateState.HOLD
    gate.send([OperatorCommand(gate.now_ns, Action.ENGAGE)])
    gate.until(GateState.ABORT, 3.1)


def test_the_operator_aborts():
    gate = in_confirmed(GateState.SERVO)
    gate.forget().send([OperatorCommand(gate.now_ns, Action.ABORT)])
    assert (gate.state, gate.last.reason) == (GateState.ABORT, "operator commanded to abort")
    assert gate.requests[0][1] is ModeRequest.HOLD
