"""The watch over parameters and other commanders: without it nothing engages and nothing moves."""

import pytest
from gate_rehearsal import NO_CHECK, Rehearsal, auto_config, pilot_config

from dfvs_core.gate.config import MS, GateTiming, S
from dfvs_core.gate.events import ModeRequest, MonitorFailed, OtherServices, ParametersRead
from dfvs_core.gate.limits import ZERO
from dfvs_core.gate.states import Cause, GateState

LOST = "failed twice"


def flying(**timing):
    config = auto_config(timing=GateTiming(response_ns=0, **timing))
    return Rehearsal(config).until(GateState.SERVO).run(1.1)


def end_watch(gate):
    gate.now_ns += MS
    return gate.send([MonitorFailed(gate.now_ns, LOST)])


@pytest.mark.parametrize("name", ["others_watched", "parameters_told"])
def test_what_was_never_watched_keeps_the_gate_from_ready(name):
    gate = Rehearsal(pilot_config())
    setattr(gate.vehicle, name, False)
    assert gate.run(3.0).state is GateState.PREFLIGHT
    setattr(gate.vehicle, name, True)
    gate.until(GateState.READY)


def test_a_watch_that_ended_keeps_the_gate_from_ready_for_good():
    gate = Rehearsal(pilot_config()).until(GateState.READY)
    end_watch(gate)
    gate.until(GateState.PREFLIGHT, 1.0)
    assert gate.last.detail == f"watch: watch lost, {LOST}"
    assert gate.run(10.0).state is GateState.PREFLIGHT


def test_a_watch_that_ends_in_flight_stops_at_once_and_aborts_with_the_reason():
    gate = flying()
    assert end_watch(gate).setpoint == ZERO
    assert (gate.state, gate.last.cause) == (GateState.HOLD, Cause.WATCH_LOST)
    gate.until(GateState.ABORT, 4.0)
    assert gate.last.reason == f"held too long: watch lost: {LOST}"
    assert gate.requests[-1][1] is ModeRequest.HOLD


@pytest.mark.parametrize(
    ("name", "limit", "event", "detail"),
    [
        ("others_watched", "services_age_ns", OtherServices, "other services"),
        ("parameters_told", "parameters_age_ns", ParametersRead, "failsafe parameters"),
    ],
)
def test_a_watch_that_falls_silent_stops_the_vehicle_until_it_speaks_again(
    name, limit, event, detail
):
    gate = flying(**{limit: 2 * S})
    last_ns = gate.now_ns
    setattr(gate.vehicle, name, False)
    gate.run(2.0)
    assert gate.now_ns - last_ns == 2 * S
    assert gate.state is GateState.SERVO
    gate.tick()
    assert (gate.state, gate.last.cause) == (GateState.HOLD, Cause.WATCH_LOST)
    assert gate.last.detail.startswith(f"{detail}, last one 2.0")
    gate.run(1.5)
    assert gate.state is GateState.HOLD
    gate.send([event(gate.now_ns)])
    setattr(gate.vehicle, name, True)
    gate.tick()
    assert gate.state is GateState.SERVO


def test_an_engagement_without_a_watch_begins_in_hold():
    gate = Rehearsal(NO_CHECK).until(GateState.ENGAGE)
    end_watch(gate)
    gate.until(GateState.HOLD, 3.0)
    assert (gate.last.source, gate.last.cause) == (GateState.ENGAGE, Cause.WATCH_LOST)


TERMINATES = "COM_OBL_RC_ACT is 6 (terminate): the vehicle would fall"


def refuse(gate, *refusals):
    """A reading of parameters that are refused, and none after it."""
    gate.vehicle.parameters_told = False
    gate.now_ns += MS
    return gate.send([ParametersRead(gate.now_ns, refusals=refusals)])


def test_parameters_that_are_refused_in_flight_stop_at_once_and_abort_with_the_reason():
    gate = flying()
    assert refuse(gate, TERMINATES, "b").setpoint == ZERO
    assert (gate.state, gate.last.cause) == (GateState.HOLD, Cause.PARAMETERS_REFUSED)
    assert gate.last.detail == f"{TERMINATES}; b"
    gate.until(GateState.ABORT, 4.0)
    assert gate.last.reason == f"held too long: parameters refused: {TERMINATES}; b"
    assert gate.requests[-1][1] is ModeRequest.HOLD


def test_parameters_that_are_set_right_within_three_seconds_let_the_flight_go_on():
    gate = flying()
    refuse(gate, TERMINATES)
    gate.run(2.0)
    assert gate.state is GateState.HOLD
    gate.vehicle.parameters_told = True
    gate.tick()
    assert gate.state is GateState.SERVO


def test_advice_in_flight_stops_nothing():
    gate = flying()
    gate.tick(ParametersRead(gate.now_ns, advice=("COM_OF_LOSS_T is 1; 0.5 is advised",)))
    assert gate.state is GateState.SERVO


def test_an_engagement_with_refused_parameters_begins_in_hold():
    gate = Rehearsal(NO_CHECK).until(GateState.ENGAGE)
    refuse(gate, TERMINATES)
    gate.until(GateState.HOLD, 3.0)
    assert (gate.last.source, gate.last.cause) == (GateState.ENGAGE, Cause.PARAMETERS_REFUSED)
