"""The check `health` of a flying vehicle whose estimate PX4 warns of for a moment."""

import dataclasses

import pytest
from gate_rehearsal import TICK_NS, Rehearsal, S, pilot_config

from dfvs_core.gate.checks.preflight import Check, preflight
from dfvs_core.gate.events import EstimatorState
from dfvs_core.gate.states import GateState

DETAIL = "not healthy: attitude and position estimate"
SEE = "see what the ground station says; "
ON_GROUND = f"{SEE}calibrate, or wait until the autopilot is ready to arm"
IN_FLIGHT = f"{SEE}where it does not pass, land and repair it on the ground"
PASSES = Check(
    "health", True, f"{DETAIL}, for less than 5 s; the check estimator passes and counts until then"
)


def ready(**vehicle: object) -> Rehearsal:
    gate = Rehearsal(pilot_config())
    gate.vehicle = dataclasses.replace(gate.vehicle, **vehicle)
    return gate.until(GateState.READY).forget()


def health(gate: Rehearsal) -> Check:
    return {check.name: check for check in gate.machine.checks()}["health"]


def test_in_the_air_a_flicker_of_the_estimate_s_bit_leaves_the_gate_ready() -> None:
    gate = ready()
    for _ in range(4):
        gate.vehicle.doubts_estimate = True
        gate.run(1.0)
        assert health(gate) == PASSES
        gate.vehicle.doubts_estimate = False
        gate.run(0.2)
        assert health(gate) == Check("health", True)
    assert gate.state is GateState.READY
    assert gate.transitions == []


def test_in_the_air_the_bit_may_be_gone_before_the_gate_is_ready() -> None:
    gate = Rehearsal(pilot_config())
    gate.vehicle.doubts_estimate = True
    assert gate.run(2.0).state is GateState.READY


def test_in_the_air_a_bit_that_stays_away_refuses() -> None:
    gate = ready()
    gate.vehicle.doubts_estimate = True
    gate.run(5.0)
    assert gate.state is GateState.READY
    gate.run(1.0)
    assert gate.state is GateState.PREFLIGHT
    assert health(gate) == Check("health", False, DETAIL, IN_FLIGHT)


def test_on_the_ground_the_bit_refuses_at_once() -> None:
    gate = ready(armed=False, in_air=False)
    gate.vehicle.doubts_estimate = True
    gate.run(1.0)
    assert gate.state is GateState.PREFLIGHT
    assert health(gate) == Check("health", False, DETAIL, ON_GROUND)


@pytest.mark.parametrize(("armed", "in_air"), [(True, False), (False, True)])
def test_an_armed_vehicle_on_the_ground_does_not_fly(armed: bool, in_air: bool) -> None:
    gate = ready(armed=armed, in_air=in_air)
    gate.vehicle.doubts_estimate = True
    gate.run(0.1)
    assert not health(gate).ok


def test_a_sensor_that_fails_refuses_at_once_in_the_air() -> None:
    gate = ready()
    gate.vehicle.healthy = False
    gate.run(0.1)
    assert health(gate) == Check("health", False, "not healthy: gyroscope", IN_FLIGHT)
    gate.vehicle.doubts_estimate = True
    gate.run(0.1)
    assert not health(gate).ok
    assert gate.run(1.0).state is GateState.PREFLIGHT


def test_an_estimate_that_is_invalid_refuses_by_both_checks() -> None:
    gate = ready()
    gate.vehicle.doubts_estimate = True
    gate.tick(EstimatorState(gate.now_ns, valid=False, detail="no attitude"))
    refusing = [check.name for check in gate.machine.checks() if check.refuses]
    assert refusing == ["estimator", "health"]


def test_time_counts_from_the_first_message_on_end_that_is_not_healthy() -> None:
    gate = ready()
    gate.vehicle.healthy = False
    gate.run(3.0)
    gate.vehicle.healthy, gate.vehicle.doubts_estimate = True, True
    gate.run(1.0)
    assert health(gate).ok
    gate.run(2.0)
    assert not health(gate).ok


def test_the_bit_may_be_gone_for_5_s_and_no_longer() -> None:
    gate = ready()
    gate.vehicle.doubts_estimate = True
    since_ns = gate.now_ns + TICK_NS
    gate.run(4.0)
    vehicle, machine = gate.machine.vehicle, gate.machine

    def passes(now_ns: int) -> bool:
        checks = preflight(vehicle, machine.perception, gate.config, now_ns)
        return {check.name: check.ok for check in checks}["health"]

    assert passes(since_ns + 5 * S)
    assert not passes(since_ns + 5 * S + 1)


def test_a_failsafe_refuses_whatever_the_bit_says() -> None:
    gate = ready()
    gate.vehicle.doubts_estimate = True
    gate.beat(failsafe=True)
    assert health(gate).detail == "autopilot in failsafe"
