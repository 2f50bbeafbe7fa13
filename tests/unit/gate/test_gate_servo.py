"""What moves the vehicle, what stops it, and within what time."""

import itertools
import math

import pytest
from gate_rehearsal import TICK_NS, Rehearsal, auto_config, pilot_config

from dfvs_core.gate.config import MS, Engage, GateTiming, OnDone, S
from dfvs_core.gate.events import (
    Action,
    BadReport,
    EstimatorState,
    Heartbeat,
    ModeRequest,
    OperatorCommand,
    Stop,
    VehicleMode,
)
from dfvs_core.gate.limits import ZERO
from dfvs_core.gate.states import Cause, GateState

NO_CHECK = auto_config(timing=GateTiming(response_ns=0))
HANDS_OVER = auto_config(on_done=OnDone.HOLD, timing=GateTiming(response_ns=0))


def flying(config=NO_CHECK, **changes):
    gate = Rehearsal(config, **changes).until(GateState.SERVO)
    return gate.run(2.0) if config is NO_CHECK else gate


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


# --- abort ------------------------------------------------------------------------------


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


def in_confirmed(state):
    """A gate in the given state, OFFBOARD confirmed."""
    gate = Rehearsal(pilot_config(timing=GateTiming(response_ns=0))).until(GateState.READY)
    gate.beat(mode=VehicleMode.OFFBOARD)
    if state is not GateState.ENGAGE:
        gate.until(GateState.SERVO)
    if state is GateState.HOLD:
        gate.send([gate.report(healthy=False)])
    if state is GateState.DONE:
        gate.changes = {"reached": True}
        gate.until(GateState.DONE)
    assert gate.state is state
    return gate


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


# --- operator ---------------------------------------------------------------------------


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
    config = auto_config(engage=Engage.COMMAND, timing=GateTiming(response_ns=0))
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


# --- time -------------------------------------------------------------------------------


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
