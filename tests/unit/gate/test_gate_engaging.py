"""From power-on to SERVO, in the three ways to engage."""

import pytest
from gate_rehearsal import TICK_NS, Rehearsal, auto_config, pilot_config

from dfvs_core.gate.config import MS, Engage, S
from dfvs_core.gate.events import ModeRequest, VehicleMode
from dfvs_core.gate.limits import ZERO
from dfvs_core.gate.states import TRANSITIONS, Cause, GateState

COMMAND = auto_config(engage=Engage.COMMAND)


def test_nothing_is_sent_before_a_vehicle_is_heard():
    gate = Rehearsal()
    gate.vehicle.sends_heartbeat = False
    gate.run(3.0)
    assert gate.state is GateState.IDLE
    assert not gate.setpoints
    assert not gate.requests


def test_a_gate_begins_with_nothing_to_tell():
    machine = Rehearsal().machine
    assert (machine.state, machine.reason, machine.has_reached) == (GateState.IDLE, "", False)
    assert not machine.is_finished


def test_every_change_of_state_is_told_once_with_its_reason():
    gate = Rehearsal().until(GateState.PREFLIGHT)
    gate.tick()
    assert gate.machine.reason == "checks pass"
    gate.changes["reached"] = True
    gate.until(GateState.DONE).run(1.0)
    assert [(str(t.source), str(t.target), t.reason) for t in gate.transitions] == [
        ("IDLE", "PREFLIGHT", "vehicle heard"),
        ("PREFLIGHT", "READY", "checks passed"),
        ("READY", "ENGAGE", "armed and in the air"),
        ("ENGAGE", "SERVO", "OFFBOARD confirmed"),
        ("SERVO", "DONE", "goal reached"),
    ]


def test_ready_needs_all_checks_passed_for_a_second():
    gate = Rehearsal(pilot_config())
    gate.until(GateState.PREFLIGHT)
    start_ns = gate.now_ns
    gate.until(GateState.READY)
    assert gate.now_ns - start_ns == 1 * S
    assert gate.last.cause is Cause.CHECKS_PASSED


def test_ready_streams_zeros_for_the_pilot_and_asks_for_nothing():
    gate = Rehearsal(pilot_config()).until(GateState.READY).run(5.0)
    assert gate.state is GateState.READY
    assert len(gate.setpoints) > 240
    assert not gate.moved()
    assert not gate.requests


@pytest.mark.parametrize("config", [COMMAND, auto_config()])
def test_ready_is_silent_where_no_pilot_engages(config):
    gate = Rehearsal(config)
    gate.vehicle.in_air = False
    gate.until(GateState.READY).run(3.0)
    assert gate.state is GateState.READY
    assert not gate.setpoints


def test_the_pilots_switch_engages_and_one_second_of_zeros_follows():
    gate = Rehearsal(pilot_config()).until(GateState.READY)
    gate.beat(mode=VehicleMode.OFFBOARD)
    assert (gate.state, gate.last.cause) == (GateState.ENGAGE, Cause.PILOT_ENGAGED)
    start_ns = gate.now_ns
    gate.until(GateState.SERVO)
    assert gate.now_ns - start_ns >= 1 * S
    assert all(t > gate.now_ns - 20 * MS for t in gate.moved())
    assert not gate.requests


@pytest.mark.parametrize(("armed", "in_air"), [(False, True), (True, False)])
def test_offboard_on_the_ground_or_disarmed_does_not_engage(armed, in_air):
    gate = Rehearsal(pilot_config())
    gate.vehicle.armed, gate.vehicle.in_air = armed, in_air
    gate.until(GateState.READY)
    gate.beat(mode=VehicleMode.OFFBOARD)
    gate.run(3.0)
    assert gate.state is GateState.READY
    assert not gate.moved()


def test_auto_asks_for_offboard_once_after_a_second_of_zeros():
    gate = Rehearsal().until(GateState.ENGAGE)
    start_ns = gate.now_ns
    assert gate.last.cause is Cause.AUTO_ENGAGED
    gate.until(GateState.SERVO)
    assert gate.requests == [(start_ns + 1 * S, ModeRequest.OFFBOARD)]
    zeros = [t for t, v in gate.setpoints if t < gate.requests[0][0]]
    assert len(zeros) >= 48  # a second at 50 Hz
    assert gate.last.cause is Cause.OFFBOARD_CONFIRMED


@pytest.mark.parametrize("mode", sorted(set(VehicleMode) - {VehicleMode.HOLD}))
def test_auto_takes_the_vehicle_out_of_hold_alone(mode):
    gate = Rehearsal()
    gate.vehicle.mode = mode
    gate.run(8.0)
    assert gate.state in (GateState.READY, GateState.PREFLIGHT)
    assert not gate.requests


@pytest.mark.parametrize(("armed", "in_air"), [(False, True), (True, False)])
def test_auto_waits_until_armed_and_in_the_air(armed, in_air):
    gate = Rehearsal()
    gate.vehicle.armed, gate.vehicle.in_air = armed, in_air
    gate.until(GateState.READY).run(5.0)
    assert gate.state is GateState.READY
    gate.vehicle.armed = gate.vehicle.in_air = True
    gate.until(GateState.SERVO)


def test_auto_does_not_engage_in_a_moment_of_a_failing_check():
    gate = Rehearsal()
    gate.vehicle.in_air = False
    gate.until(GateState.READY)
    gate.sees = False
    gate.run(0.3)
    gate.vehicle.in_air = True
    gate.run(0.3)
    assert gate.state is GateState.READY
    gate.sees = True
    gate.tick()
    assert gate.state is GateState.ENGAGE


def test_offboard_that_is_not_confirmed_aborts_and_leaves_the_vehicle_alone():
    gate = Rehearsal()
    gate.vehicle.obeys = False
    gate.until(GateState.ENGAGE).until(GateState.ABORT)
    assert gate.last.reason == "OFFBOARD not confirmed: within 2 s"
    assert gate.last.t_ns == gate.requests[0][0] + 2 * S + TICK_NS
    gate.run(5.0)
    assert [r for _, r in gate.requests] == [ModeRequest.OFFBOARD]
    assert gate.machine.is_finished


def test_offboard_that_is_confirmed_too_late_is_given_back_to_hold():
    gate = Rehearsal()
    gate.vehicle.obeys = False
    gate.until(GateState.ABORT)
    gate.vehicle.obeys = True
    gate.beat(mode=VehicleMode.OFFBOARD)
    assert gate.requests[-1][1] is ModeRequest.HOLD
    gate.run(5.0)
    assert len(gate.requests) == 2


def test_another_mode_while_offboard_is_awaited_is_a_takeover():
    gate = Rehearsal()
    gate.vehicle.obeys = False
    gate.until(GateState.ENGAGE).run(1.5)
    gate.forget().beat(mode=VehicleMode.POSITION)
    assert (gate.state, gate.last.cause) == (GateState.RELEASED, Cause.TAKEOVER)
    gate.run(5.0)
    assert not gate.setpoints
    assert not gate.requests


def test_without_good_data_engage_leads_to_hold():
    gate = Rehearsal().until(GateState.ENGAGE)
    gate.sees = False
    gate.until(GateState.HOLD)
    assert (gate.last.cause, gate.last.detail) == (Cause.FRAME_OLD, "260 ms")
    assert not gate.moved()


def test_failing_checks_lead_back_to_preflight_after_half_a_second():
    gate = Rehearsal(pilot_config()).until(GateState.READY)
    gate.vehicle.battery = 0.1
    gate.tick()
    failing_ns = gate.now_ns
    gate.until(GateState.PREFLIGHT, 1.0)
    assert gate.last.t_ns - failing_ns == 500 * MS
    assert gate.last.cause is Cause.CHECKS_FAILED
    assert "battery" in gate.last.detail


def test_checks_that_fail_for_moments_do_not_add_up():
    gate = Rehearsal(pilot_config()).until(GateState.READY)
    for _ in range(5):
        gate.vehicle.battery = 0.1
        gate.run(0.4)
        gate.vehicle.battery = 0.9
        gate.tick()
    assert gate.state is GateState.READY


def test_an_old_failure_does_not_count_when_ready_again():
    gate = Rehearsal(pilot_config()).until(GateState.READY)
    gate.vehicle.battery = 0.1
    gate.until(GateState.PREFLIGHT)
    gate.vehicle.battery = 0.9
    gate.until(GateState.READY)
    gate.vehicle.battery = 0.1
    gate.run(0.4)
    assert gate.state is GateState.READY


def test_zeros_go_on_until_a_heartbeat_could_tell_of_the_pilots_switch():
    gate = Rehearsal(pilot_config()).until(GateState.READY)
    gate.vehicle.battery = 0.1
    gate.until(GateState.PREFLIGHT)
    left_ns = gate.now_ns
    gate.forget().run(7.0)
    assert len(gate.setpoints) == 75  # 1.5 s at 50 Hz
    assert gate.setpoints[-1] == (left_ns + 1500 * MS, ZERO)


def test_offboard_chosen_in_that_time_is_given_back_to_hold():
    gate = Rehearsal(pilot_config()).until(GateState.READY)
    gate.vehicle.battery = 0.1
    gate.until(GateState.PREFLIGHT)
    gate.beat(mode=VehicleMode.HOLD)
    assert gate.state is GateState.PREFLIGHT
    gate.beat(mode=VehicleMode.OFFBOARD)
    assert (gate.state, gate.last.cause) == (GateState.ABORT, Cause.OFFBOARD_NOT_READY)
    assert "battery" in gate.last.detail
    assert [r for _, r in gate.requests] == [ModeRequest.HOLD]


def test_a_vehicle_under_somebody_elses_offboard_is_left_alone():
    gate = Rehearsal(pilot_config())
    gate.vehicle.mode = VehicleMode.OFFBOARD
    gate.run(8.0)
    assert gate.state is GateState.PREFLIGHT
    assert "not by this service" in gate.machine.reason
    assert not gate.setpoints
    assert not gate.requests


def test_zero_setpoints_keep_their_rhythm():
    gate = Rehearsal(pilot_config()).until(GateState.READY).forget()
    for _ in range(400):  # called far more often than every 20 ms
        gate.now_ns += 3 * MS
        gate.send(gate.nominal())
    gaps = [b[0] - a[0] for a, b in zip(gate.setpoints, gate.setpoints[1:], strict=False)]
    assert min(gaps) >= 15 * MS
    assert max(gaps) <= 18 * MS
    assert all(v == ZERO for _, v in gate.setpoints)


def test_the_table_of_transitions_never_leads_into_motion_from_an_end():
    for end in (GateState.DONE, GateState.ABORT, GateState.RELEASED):
        assert not TRANSITIONS[end] & {GateState.ENGAGE, GateState.SERVO}
    for end in (GateState.ABORT, GateState.RELEASED):
        assert GateState.HOLD not in TRANSITIONS[end]
