"""What the gate makes of time that leaps."""

from gate_rehearsal import flying

from dfvs_core.gate.config import S
from dfvs_core.gate.events import (
    Heartbeat,
    VehicleMode,
)
from dfvs_core.gate.limits import ZERO
from dfvs_core.gate.states import Cause, GateState


def test_time_that_goes_backwards_changes_nothing():
    gate = flying()
    output = gate.machine.step(gate.now_ns - 100 * S, [])
    assert gate.state is GateState.SERVO
    assert output.setpoint is None
    gate.run(1.0)
    assert gate.state is GateState.SERVO


def test_a_message_from_the_future_counts_as_of_now():
    gate = flying()
    gate.send([Heartbeat(gate.now_ns + 1000 * S, VehicleMode.OFFBOARD, armed=True)])
    gate.vehicle.sends_heartbeat = False
    gate.until(GateState.ABORT, 2.1)
    assert gate.last.cause is Cause.HEARTBEAT_LOST


def test_a_leap_in_time_brakes():
    gate = flying()
    gate.now_ns += 3600 * S
    output = gate.send([])
    assert output.setpoint == ZERO
    assert gate.state is GateState.ABORT
    assert not output.mode_request
