import math

import pytest
from gate_rehearsal import Rehearsal, auto_config, flying, pilot_config

from dfvs_core.gate.config import MS, S
from dfvs_core.gate.events import (
    ForeignSetpoint,
    Heartbeat,
    ModeRequest,
    OtherServices,
    VehicleMode,
    VelocityTarget,
)
from dfvs_core.gate.limits import ZERO, BodyVelocity
from dfvs_core.gate.other_commanders import (
    MAX_UNEXPLAINED_M_S,
    SEEN_NS,
    UNEXPLAINED_TARGETS,
    OtherCommanders,
)
from dfvs_core.gate.states import Cause, GateState


def target(gate, velocity=(0.5, 0.5, 0.0)):
    return VelocityTarget(gate.now_ns, velocity)


@pytest.mark.parametrize("place", ["standing_by", "engaged"])
def test_a_second_service_keeps_both_from_engaging(place):
    gate = Rehearsal(auto_config())
    gate.others = (("b7",), ()) if place == "standing_by" else ((), ("b7",))
    gate.run(3.0)
    assert gate.state is GateState.PREFLIGHT
    assert "another service for this vehicle runs (b7): stop one of them" in gate.machine.reason
    gate.others = ()
    gate.until(GateState.SERVO)


def test_a_service_that_comes_up_takes_ready_back():
    gate = Rehearsal(pilot_config()).until(GateState.READY)
    gate.others = (("b7",),)
    gate.run(0.6)
    assert (gate.state, gate.last.cause) == (GateState.PREFLIGHT, Cause.CHECKS_FAILED)


def test_a_service_that_stands_by_does_not_end_a_flight_one_that_is_engaged_does():
    gate = flying()
    gate.others = (("b7",),)
    gate.run(1.0)
    assert gate.state is GateState.SERVO
    output = gate.send([OtherServices(gate.now_ns, engaged=("b7",))])
    assert (gate.state, gate.last.cause) == (GateState.ABORT, Cause.TWO_COMMANDERS)
    assert "b7" in gate.last.detail
    assert output.setpoint == ZERO
    assert output.mode_request is ModeRequest.HOLD


@pytest.mark.parametrize("state", [GateState.ENGAGE, GateState.SERVO, GateState.HOLD])
def test_a_foreign_setpoint_aborts_at_once(state):
    gate = flying()
    if state is GateState.ENGAGE:
        gate = Rehearsal(auto_config()).until(GateState.ENGAGE)
    if state is GateState.HOLD:
        gate.send([gate.report(healthy=False)])
    assert gate.state is state
    gate.send([ForeignSetpoint(gate.now_ns, "SET_ATTITUDE_TARGET of system 1, component 196")])
    assert (gate.state, gate.last.cause) == (GateState.ABORT, Cause.TWO_COMMANDERS)
    assert "component 196" in gate.last.detail


def test_a_foreign_setpoint_forbids_to_engage_for_five_seconds():
    gate = Rehearsal(auto_config()).run(0.5)
    gate.send([ForeignSetpoint(gate.now_ns, "x")])
    heard_ns = gate.now_ns
    gate.until(GateState.READY)
    assert gate.now_ns - heard_ns >= SEEN_NS + 1 * S
    assert gate.until(GateState.SERVO).state is GateState.SERVO  # an old one counts no more


def test_for_exactly_five_seconds_a_foreign_setpoint_is_named():
    others = OtherCommanders()
    others.update(ForeignSetpoint(7, "x"), 0.0)
    assert others.preflight_fault(7 + SEEN_NS) == "somebody else sends setpoints (x)"
    assert others.preflight_fault(8 + SEEN_NS) == ""


def test_every_other_service_is_named():
    others = OtherCommanders()
    others.update(OtherServices(1, engaged=("a", "b")), 0.0)
    assert others.flight_fault(0) == (Cause.TWO_COMMANDERS, "another service is engaged (a, b)")


def odd_targets(gate, count):
    for _ in range(count):
        gate.now_ns += 20 * MS
        gate.send([*gate.nominal(), target(gate)])


def test_a_velocity_never_asked_for_aborts_once_a_heartbeat_still_shows_offboard():
    gate = flying()
    odd_targets(gate, 20)
    assert gate.state is GateState.SERVO  # it may be a pilot's takeover
    gate.beat()
    odd_targets(gate, UNEXPLAINED_TARGETS - 1)
    assert gate.state is GateState.SERVO
    odd_targets(gate, 1)
    assert (gate.state, gate.last.cause) == (GateState.ABORT, Cause.TWO_COMMANDERS)
    assert "m/s from any of ours" in gate.last.detail


def test_a_takeover_is_no_second_commander():
    gate = flying()
    odd_targets(gate, 20)
    gate.forget().beat(mode=VehicleMode.POSITION)
    assert (gate.state, gate.last.cause) == (GateState.RELEASED, Cause.TAKEOVER)
    assert not gate.requests


def test_the_velocity_that_was_asked_for_is_nobody_elses():
    gate = flying(asked=(0.3, 0.2, -0.1, 0.2))
    for i in range(150):
        gate.tick()
        north, east, down = gate.velocity_ned()
        gate.send([target(gate, (north + 0.05, east, down))])
        if i % 50 == 0:
            gate.beat()
    assert gate.state is GateState.SERVO


def beat(others, t_ns):
    """A heartbeat that shows OFFBOARD."""
    others.on_heartbeat(Heartbeat(t_ns, VehicleMode.OFFBOARD, armed=True), is_offboard=True)


def judged(others, velocity, now_ns, yaw_rad=0.0):
    """Whether a target counts as odd: the first one before a heartbeat, the others after it."""
    others.update(VelocityTarget(now_ns, velocity), yaw_rad)
    beat(others, now_ns + 1)
    for i in range(UNEXPLAINED_TARGETS):
        others.update(VelocityTarget(now_ns + 2 + i, velocity), yaw_rad)
    return others.flight_fault(0) is not None


FORWARD, RIGHT = BodyVelocity(0.4), BodyVelocity(0.0, 0.4)


@pytest.mark.parametrize(
    ("sent", "velocity", "yaw_rad", "is_odd"),
    [
        (FORWARD, (0.4, 0.0, 0.0), 0.0, False),
        (FORWARD, (0.59, 0.0, 0.0), 0.0, False),
        (FORWARD, (0.61, 0.0, 0.0), 0.0, True),
        (FORWARD, (0.4, 0.0, 0.21), 0.0, True),
        (FORWARD, (0.0, 0.4, 0.0), math.pi / 2, False),
        (FORWARD, (0.4, 0.0, 0.0), math.pi / 2, True),
        (RIGHT, (-0.4, 0.0, 0.0), math.pi / 2, False),  # south, of who heads east
        (RIGHT, (0.4, 0.0, 0.0), math.pi / 2, True),
        (FORWARD, (math.nan, 0.0, 0.0), 0.0, False),
        (FORWARD, (0.9, 0.0, 0.0), math.nan, False),
        (ZERO, (MAX_UNEXPLAINED_M_S, 0.0, 0.0), 0.0, False),
        (ZERO, (math.nextafter(MAX_UNEXPLAINED_M_S, 1.0), 0.0, 0.0), 0.0, True),
    ],
)
def test_a_target_is_compared_in_the_vehicles_heading(sent, velocity, yaw_rad, is_odd):
    others = OtherCommanders()
    others.sent(sent, 10 * S)
    assert judged(others, velocity, 10 * S, yaw_rad) is is_odd


@pytest.mark.parametrize(("forward", "is_odd"), [(0.99, False), (0.55, False), (0.5, True)])
def test_any_setpoint_of_the_last_half_second_explains_a_target(forward, is_odd):
    others = OtherCommanders()
    for i in range(100):
        others.sent(BodyVelocity(0.01 * i), i * 20 * MS)
    assert judged(others, (forward, 0.0, 0.0), 99 * 20 * MS) is is_odd


@pytest.mark.parametrize(("late_ns", "is_odd"), [(0, False), (1, True)])
def test_what_was_sent_half_a_second_ago_still_explains_a_target(late_ns, is_odd):
    others = OtherCommanders()
    for t_ns, forward_m_s in ((0, 0.5), (10, 0.0), (10 + S // 2 + late_ns, 0.0)):
        others.sent(BodyVelocity(forward_m_s), t_ns)
    assert judged(others, (0.5, 0.0, 0.0), S) is is_odd


def test_without_a_setpoint_of_ours_no_target_is_odd():
    assert judged(OtherCommanders(), (5.0, 0.0, 0.0), S) is False


def test_a_heartbeat_as_old_as_the_first_odd_target_confirms_nothing():
    others = OtherCommanders()
    others.sent(ZERO, 0)
    others.update(VelocityTarget(5, (1.0, 0.0, 0.0)), 0.0)
    beat(others, 5)
    for t_ns in (6, 7, 8, 9):
        others.update(VelocityTarget(t_ns, (1.0, 0.0, 0.0)), 0.0)
    assert others.flight_fault(0) is None


def after_an_odd_target():
    """Others after one odd target, and a heartbeat that confirms OFFBOARD."""
    others = OtherCommanders()
    others.sent(ZERO, 0)
    others.update(VelocityTarget(1, (1.0, 0.0, 0.0)), 0.0)
    beat(others, 2)
    return others


def test_odd_targets_lapse_when_none_came_for_a_second():
    others = after_an_odd_target()
    others.update(VelocityTarget(1 * S + 2, (0.0, 0.0, 0.0)), 0.0)  # a good one, a second later
    for i in range(UNEXPLAINED_TARGETS):
        others.update(VelocityTarget(1 * S + 3 + i, (1.0, 0.0, 0.0)), 0.0)
    assert others.flight_fault(0) is None


def test_a_good_target_soon_after_an_odd_one_clears_nothing():
    """Between two setpoints of a stranger the autopilot may fly one of ours."""
    others = after_an_odd_target()
    others.update(VelocityTarget(1 + S, (0.0, 0.0, 0.0)), 0.0)
    for i in range(UNEXPLAINED_TARGETS):
        assert others.flight_fault(0) is None
        others.update(VelocityTarget(2 + S + i, (1.0, 0.0, 0.0)), 0.0)
    assert others.flight_fault(0) is not None
