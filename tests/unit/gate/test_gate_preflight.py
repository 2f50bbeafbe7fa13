"""Each preflight check refuses by itself, and says why."""

import math

import pytest
from gate_rehearsal import Rehearsal, pilot_config

from dfvs_core.gate.config import MS
from dfvs_core.gate.events import EstimatorState, ParametersRead
from dfvs_core.gate.machine import GateMachine
from dfvs_core.gate.states import GateState


@pytest.mark.parametrize(
    ("attribute", "value", "reason"),
    [
        ("sends_attitude", False, "attitude, none heard yet"),
        ("sends_position", False, "position, none heard yet"),
        ("battery", 0.19, "19% left, 20% needed"),
        ("battery", None, "charge unknown"),
        ("battery", math.nan, "battery low"),
        ("healthy", False, "not healthy: gyroscope"),
        ("failsafe", True, "failsafe"),
        ("roll_rad", math.nan, "attitude is not finite"),
        ("position_m", (math.inf, 0.0, 0.0), "position or velocity is not finite"),
        ("velocity_m_s", (0.0, math.nan, 0.0), "position or velocity is not finite"),
    ],
)
def test_a_vehicle_that_is_not_fit_is_refused(attribute, value, reason):
    gate = Rehearsal(pilot_config())
    setattr(gate.vehicle, attribute, value)
    gate.run(5.0)
    assert gate.state is GateState.PREFLIGHT
    assert reason in gate.machine.reason
    assert not gate.setpoints


def test_checks_before_arming_count_on_the_ground_alone():
    gate = Rehearsal(pilot_config())
    gate.vehicle.can_arm = gate.vehicle.armed = False
    gate.run(5.0)
    assert "checks before arming" in gate.machine.reason
    gate.beat(armed=True)
    gate.until(GateState.READY)


def test_an_estimate_that_the_autopilot_calls_invalid_is_refused():
    gate = Rehearsal(pilot_config())
    for _ in range(300):
        gate.tick(EstimatorState(gate.now_ns, valid=False, detail="no attitude"))
    assert gate.state is GateState.PREFLIGHT
    assert "no attitude" in gate.machine.reason


def test_no_frames_are_refused_with_perceptions_own_reason():
    gate = Rehearsal(pilot_config())
    gate.sees = False
    gate.run(5.0)
    assert gate.state is GateState.PREFLIGHT
    assert "no report yet" in gate.machine.reason


def test_a_message_that_never_came_is_named():
    gate = Rehearsal(pilot_config())
    machine = GateMachine(gate.config, gate.now_ns)
    machine.step(gate.now_ns, [gate.heartbeat()])
    events = [e for e in gate.nominal() if not hasattr(e, "in_air")]
    machine.step(gate.now_ns + MS, events)
    reasons = {check.name: check.detail for check in machine.checks() if check.refuses}
    assert reasons.pop("frames").startswith("1.0 a second")
    assert reasons == {"link": "vehicle's telemetry lost, landed state, none heard yet"}


def test_a_check_that_fails_for_a_moment_starts_the_second_anew():
    gate = Rehearsal(pilot_config()).until(GateState.PREFLIGHT).run(0.8)
    gate.vehicle.healthy = False
    gate.tick()
    gate.vehicle.healthy = True
    gate.run(0.9)
    assert gate.state is GateState.PREFLIGHT
    gate.until(GateState.READY, 0.2)


def test_a_jump_of_the_position_before_the_flight_is_forgotten():
    gate = Rehearsal(pilot_config()).until(GateState.PREFLIGHT)
    gate.vehicle.position_m = (50.0, 2.0, -3.0)
    gate.tick()
    gate.tick()
    gate.until(GateState.READY, 1.2)


def test_a_failsafe_that_is_dangerous_or_not_known_is_refused():
    gate = Rehearsal(pilot_config())
    refusal = "COM_OF_LOSS_T is 60 s, 1 at most"
    for _ in range(200):
        gate.tick(ParametersRead(gate.now_ns, refusals=(refusal,)))
    assert gate.state is GateState.PREFLIGHT
    assert refusal in gate.machine.reason
    gate.until(GateState.READY, 1.2)


@pytest.mark.parametrize(("every", "starts"), [(5, True), (12, False)])
def test_too_few_good_frames_a_second_are_refused(every, starts):
    gate = Rehearsal(pilot_config(min_frame_hz=5.0), latency_ns=0)
    reasons = set()
    for i in range(300):
        gate.sees = i % every == 0
        gate.tick()
        reasons.add(gate.machine.reason)
    assert (gate.state is GateState.READY) is starts
    assert starts or any("5 needed" in reason for reason in reasons)
