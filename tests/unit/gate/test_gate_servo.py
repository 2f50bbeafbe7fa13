"""What moves the vehicle, what stops it, and within what time."""

import dataclasses
import itertools
import math

import pytest
from gate_rehearsal import NO_CHECK, TICK_NS, Rehearsal, flying

from dfvs_core.gate.config import MS, OnDone, S
from dfvs_core.gate.events import (
    BadReport,
    ModeRequest,
    VehicleMode,
)
from dfvs_core.gate.limits import ZERO
from dfvs_core.gate.states import Cause, GateState

HANDS_OVER = dataclasses.replace(NO_CHECK, on_done=OnDone.HOLD)


def test_servo_follows_perception_within_limits():
    gate = flying()
    assert gate.setpoints[-1][1].forward_m_s == pytest.approx(0.4)
    gate.asked = (3.0, 0.0, 0.6, 0.0)
    gate.run(3.0)
    out = gate.setpoints[-1][1]
    assert out.forward_m_s == pytest.approx(0.5)
    assert out.down_m_s == pytest.approx(0.1)


def test_servo_begins_from_zero_and_slews():
    gate = Rehearsal(NO_CHECK).until(GateState.SERVO).run(0.5)
    speeds = [v.forward_m_s for _, v in gate.setpoints if v != ZERO]
    assert speeds[0] <= 0.5 * 0.1 + 1e-12  # one step of at most 0.1 s at 0.5 m/s²
    steps = [b - a for a, b in itertools.pairwise(speeds)]
    assert max(steps) <= 0.5 * 0.02 + 1e-9


def test_setpoints_never_pause_while_engaged():
    gate = flying().run(5.0)
    times = [t for t, _ in gate.setpoints]
    assert max(b - a for a, b in itertools.pairwise(times)) <= TICK_NS


def test_zero_follows_within_300_ms_of_the_last_good_frame():
    gate = flying()
    capture_ns = gate.machine.perception.last_capture_ns
    gate.sees = False
    gate.forget().until(GateState.HOLD)
    zero_ns = next(t for t, v in gate.setpoints if v == ZERO)
    assert zero_ns - capture_ns <= 300 * MS
    assert gate.last.cause is Cause.FRAME_OLD


@pytest.mark.parametrize(
    ("changes", "reason"),
    [
        ({"healthy": False, "reason": "black"}, "perception unhealthy: black"),
        ({"velocity": (math.nan, 0.0, 0.0, 0.0)}, "report rejected: numbers that are not finite"),
        ({"velocity": (0.0, math.inf, 0.0, 0.0)}, "report rejected: numbers that are not finite"),
        ({"velocity": (0.0, 11.0, 0.0, 0.0)}, "report rejected: speed over 10 m/s"),
        ({"velocity": (0.0, 0.0, 0.0, -11.0)}, "report rejected: yaw rate over 10 rad/s"),
        ({"velocity": (0.1, 0.1)}, "report rejected: numbers that are not finite"),
        ({"error_m": math.nan}, "report rejected: numbers that are not finite"),
        ({"error_m": -0.1}, "report rejected: error or overlap out of range"),
        ({"error_rad": math.nan}, "report rejected: numbers that are not finite"),
        ({"error_rad": -0.1}, "report rejected: error or overlap out of range"),
        ({"overlap": 1.1}, "report rejected: error or overlap out of range"),
        ({"overlap": -0.1}, "report rejected: error or overlap out of range"),
        ({"feature_error": math.nan}, "report rejected: feature error out of range"),
        ({"feature_error": math.inf}, "report rejected: feature error out of range"),
        ({"feature_error": -0.1}, "report rejected: feature error out of range"),
        ({"mounting_score": math.nan}, "report rejected: mounting score out of range"),
        ({"mounting_score": math.inf}, "report rejected: mounting score out of range"),
        ({"mounting_score": -math.inf}, "report rejected: mounting score out of range"),
    ],
)
def test_a_bad_report_stops_in_the_same_step(changes, reason):
    gate = flying()
    output = gate.look(**changes)
    assert output.setpoint == ZERO
    assert (gate.state, gate.last.reason) == (GateState.HOLD, reason)


def test_a_report_of_the_future_stops():
    gate = flying()
    output = gate.send([gate.report(t_capture_ns=gate.now_ns + 6 * MS)])
    assert output.setpoint == ZERO
    assert gate.last.reason == "report rejected: captured 6 ms in the future"


@pytest.mark.parametrize("shift_ns", [200 * MS, 201 * MS, 10 * S, -5 * MS])
def test_a_report_just_in_time_or_late_does_not_stop(shift_ns):
    gate = flying()
    gate.send([gate.report(t_capture_ns=gate.now_ns - shift_ns)])
    assert gate.state is GateState.SERVO


def test_a_repeated_capture_refreshes_nothing():
    gate = flying()
    frozen_ns = gate.machine.perception.last_capture_ns
    gate.sees = False
    for _ in range(14):
        gate.tick(gate.report(t_capture_ns=frozen_ns))
    assert gate.state is GateState.HOLD
    assert gate.now_ns - frozen_ns > 250 * MS


def test_a_datagram_that_is_no_report_stops():
    gate = flying()
    output = gate.send([BadReport(gate.now_ns, "not JSON")])
    assert output.setpoint == ZERO
    assert gate.last.reason == gate.machine.reason == "report rejected: not JSON"


@pytest.mark.parametrize(("late_ns", "stalled"), [(0, False), (1, True)])
def test_a_gate_that_stalled_stops(late_ns, stalled):
    gate = flying()
    gate.now_ns += 150 * MS + late_ns
    output = gate.send([])
    assert gate.state is (GateState.HOLD if stalled else GateState.SERVO)
    assert (output.setpoint == ZERO) is stalled


def test_a_good_report_right_after_a_fault_does_not_undo_it():
    for fault in (Rehearsal().report(healthy=False), BadReport(0, "not JSON")):
        gate = flying()
        gate.now_ns += 5 * MS
        output = gate.send([fault, gate.report()])
        assert output.setpoint == ZERO
        assert gate.state is GateState.HOLD


def test_a_good_report_right_after_a_stall_does_not_undo_it():
    gate = flying()
    gate.now_ns += 151 * MS
    gate.send([gate.report()])
    assert (gate.state, gate.last.cause) == (GateState.HOLD, Cause.GATE_STALLED)
    assert gate.last.detail == "for 151 ms"


def test_after_a_second_of_good_data_hold_moves_again_from_zero():
    gate = flying()
    gate.send([gate.report(healthy=False)])
    hold_ns = gate.now_ns
    gate.forget().until(GateState.SERVO)
    assert gate.now_ns - hold_ns == 1 * S + TICK_NS  # the first good report comes a tick later
    assert gate.last.cause is Cause.DATA_GOOD
    assert [v for t, v in gate.setpoints if t < gate.now_ns] == [ZERO] * (len(gate.setpoints) - 1)
    assert gate.setpoints[-1][1].speed_m_s <= 0.5 * 0.02 + 1e-9


def test_one_bad_report_starts_that_second_anew():
    gate = flying()
    gate.send([gate.report(healthy=False)])
    gate.run(0.9)
    gate.send([gate.report(healthy=False)])
    gate.run(0.9)
    assert gate.state is GateState.HOLD


def test_hold_over_three_seconds_aborts():
    gate = flying()
    gate.sees = False
    gate.until(GateState.HOLD)
    start_ns = gate.now_ns
    gate.until(GateState.ABORT)
    assert gate.now_ns - start_ns == 3 * S + TICK_NS
    assert gate.last.reason == "held too long: last good frame too old: 260 ms"


def held_for_a_refused_frame(overlap):
    gate = Rehearsal().until(GateState.SERVO)
    gate.send([gate.report(healthy=False, reason="no agreement")])
    gate.changes = {"overlap": overlap}
    return gate


def test_held_too_long_names_an_overlap_that_is_too_small_and_no_fault_that_has_passed():
    gate = held_for_a_refused_frame(0.08).until(GateState.ABORT, 3.2)
    assert gate.last.reason == "held too long: overlap 8%, 9% needed"


def test_held_too_long_names_the_present_fault_before_the_overlap():
    gate = held_for_a_refused_frame(0.08).run(2.0)
    gate.sees = False
    gate.until(GateState.ABORT, 1.2)
    assert gate.last.reason == "held too long: last good frame too old: 260 ms"


def test_held_too_long_names_the_last_fault_where_data_are_good_for_less_than_a_second():
    gate = held_for_a_refused_frame(0.8).run(0.9)
    for _ in range(2):
        gate.send([gate.report(healthy=False, reason="too little")])
        gate.run(0.9)
    gate.send([gate.report(healthy=False, reason="too little")])
    gate.until(GateState.ABORT, 1.0)
    assert gate.last.reason == "held too long: perception unhealthy: too little"


def test_once_confirmed_no_overlap_keeps_a_hold():
    gate = Rehearsal().until(GateState.SERVO).run(2.0)
    gate.send([gate.report(healthy=False, reason="no agreement")])
    gate.changes = {"overlap": 0.01}
    gate.until(GateState.SERVO, 1.2)


def test_the_goal_within_tolerance_for_a_second_is_done():
    gate = flying()
    gate.changes = {"reached": True}
    start_ns = gate.now_ns
    gate.until(GateState.DONE)
    assert 1 * S <= gate.now_ns - start_ns <= 1 * S + 40 * MS
    assert gate.machine.has_reached
    assert gate.last.cause is Cause.GOAL_REACHED


def test_a_frame_out_of_tolerance_starts_that_second_anew():
    gate = flying()
    gate.changes = {"reached": True}
    gate.run(0.9)
    gate.now_ns += MS
    gate.send([gate.report(reached=False)])
    gate.run(0.9)
    assert gate.state is GateState.SERVO


def test_done_streams_zeros_for_ever():
    gate = flying()
    gate.changes = {"reached": True}
    gate.until(GateState.DONE).forget()
    gate.sees = False
    gate.run(200.0)  # longer than the cap on time engaged
    assert gate.state is GateState.DONE
    assert not gate.moved()
    assert len(gate.setpoints) >= 9_900
    assert not gate.requests
    assert not gate.machine.is_finished


def test_done_can_hand_over_to_the_autopilots_hold():
    gate = Rehearsal(HANDS_OVER).until(GateState.SERVO)
    gate.changes = {"reached": True}
    gate.until(GateState.DONE)
    assert gate.requests[-1][1] is ModeRequest.HOLD
    gate.run(1.5).forget()
    assert gate.machine.is_finished
    gate.beat(mode=VehicleMode.POSITION)
    gate.run(3.0)
    assert gate.state is GateState.DONE
    assert not gate.setpoints
    assert not gate.requests


def test_a_hold_that_is_not_confirmed_is_asked_for_once_more_and_left_to_the_autopilot():
    """A request may be lost, or refused: PX4 needs a global position for Hold."""
    gate = Rehearsal(HANDS_OVER).until(GateState.SERVO)
    gate.changes, gate.vehicle.obeys = {"reached": True}, False
    gate.until(GateState.DONE).forget()
    gate.run(2.0)
    assert gate.state is GateState.DONE
    assert len(gate.setpoints) >= 99
    assert not gate.requests
    gate.run(3.0)
    assert (gate.state, gate.last.cause) == (GateState.ABORT, Cause.HOLD_NOT_CONFIRMED)
    assert gate.last.detail == "within 2 s"
    assert [request for _, request in gate.requests] == [ModeRequest.HOLD]
    assert gate.machine.is_finished


def test_another_mode_than_the_awaited_hold_is_a_takeover():
    gate = Rehearsal(HANDS_OVER).until(GateState.SERVO)
    gate.changes, gate.vehicle.obeys = {"reached": True}, False
    gate.until(GateState.DONE)
    gate.beat(mode=VehicleMode.POSITION)
    assert gate.state is GateState.RELEASED
