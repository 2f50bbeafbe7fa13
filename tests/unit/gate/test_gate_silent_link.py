"""After a silence of the link the mode is known only by a message that comes later."""

import pytest
from gate_rehearsal import Rehearsal, auto_config, pilot_config

from dfvs_core.gate.config import MS, GateTiming, OnDone
from dfvs_core.gate.events import (
    Action,
    Attitude,
    CurrentMode,
    LocalPosition,
    ModeRequest,
    VehicleMode,
)
from dfvs_core.gate.states import Cause, GateState

TIMING = GateTiming()


def lose_the_link(gate):
    """Nothing comes down any more."""
    v = gate.vehicle
    v.sends_heartbeat = v.sends_attitude = v.sends_position = v.sends_status = False


def restore_the_link(gate):
    """All but the heartbeat comes down again."""
    v = gate.vehicle
    v.sends_attitude = v.sends_position = v.sends_status = True


def interrupt_the_link(gate, seconds, *, taken_over=False):
    """Nothing comes down for so long; the pilot may take over meanwhile."""
    lose_the_link(gate)
    if taken_over:
        take_over(gate)
    gate.run(seconds)
    restore_the_link(gate)


def take_over(gate):
    """The pilot selects Position, and no message of it is received."""
    gate.vehicle.mode, gate.vehicle.obeys = VehicleMode.POSITION, False


def in_servo(**changes):
    gate = Rehearsal(pilot_config(**changes)).until(GateState.READY)
    gate.tell_mode(VehicleMode.OFFBOARD)
    return gate.until(GateState.SERVO).run(2.5)


def in_engage():
    """A gate that asks for OFFBOARD in 0.4 s, right after a heartbeat."""
    gate = Rehearsal(auto_config()).until(GateState.ENGAGE).run(0.6)
    gate.beat()
    return gate.forget()


def at_the_goal():
    """A gate that is at the goal in 0.3 s, right after a heartbeat."""
    gate = in_servo(on_done=OnDone.HOLD)
    gate.changes["reached"] = True
    gate.run(0.7)
    gate.beat()
    return gate.forget()


def modes_requested(gate):
    return [mode for _, mode in gate.requests]


# --- a takeover that nobody was told of -------------------------------------------------------


def test_a_flight_that_ends_with_the_link_takes_nothing_from_a_pilot():
    gate = in_servo()
    gate.beat()
    lose_the_link(gate)
    take_over(gate)
    gate.run(0.56)
    assert (gate.state, gate.last.cause) == (GateState.ABORT, Cause.TELEMETRY_LOST)
    restore_the_link(gate)
    gate.run(0.5)
    assert gate.machine.stream.is_silent is False
    gate.tell_mode(VehicleMode.POSITION)
    assert gate.machine.is_finished
    assert not gate.requests


@pytest.mark.parametrize("beat_s", [0.0, 0.3, 0.6, 0.9])
def test_with_the_downlink_alone_lost_no_hold_takes_the_vehicle_from_a_pilot(beat_s):
    gate = Rehearsal(pilot_config()).until(GateState.READY)
    gate.vehicle.mode = VehicleMode.OFFBOARD
    gate.until(GateState.SERVO).run(1.0 + beat_s).forget()
    lose_the_link(gate)
    gate.run(0.2)
    gate.vehicle.mode = VehicleMode.POSITION
    gate.run(3.0)
    assert (gate.state, gate.last.cause) == (GateState.ABORT, Cause.TELEMETRY_LOST)
    assert not gate.requests
    assert gate.machine.is_finished


def test_a_link_that_returns_in_time_is_asked_for_hold_once():
    gate = Rehearsal(auto_config()).until(GateState.SERVO).run(1.0).forget()
    lose_the_link(gate)
    gate.until(GateState.ABORT, 0.6)
    gate.vehicle.sends_attitude = True
    gate.run(0.3)
    assert not gate.requests
    gate.vehicle.sends_heartbeat = True
    gate.run(1.0)
    assert [r for _, r in gate.requests] == [ModeRequest.HOLD]


def test_an_abort_right_after_a_short_silence_takes_nothing_from_a_pilot():
    gate = in_servo()
    gate.beat()
    interrupt_the_link(gate, 0.3, taken_over=True)
    gate.tick()
    gate.command(Action.ABORT)
    gate.run(0.5)
    gate.tell_mode(VehicleMode.POSITION)
    assert gate.machine.is_finished
    assert not gate.requests


def test_engaging_takes_nothing_from_a_pilot():
    gate = in_engage()
    interrupt_the_link(gate, 0.44, taken_over=True)
    gate.run(0.3)
    gate.tell_mode(VehicleMode.POSITION)
    assert (gate.state, gate.last.cause) == (GateState.RELEASED, Cause.TAKEOVER)
    assert not gate.requests


def test_a_goal_that_is_reached_takes_nothing_from_a_pilot():
    gate = at_the_goal()
    lose_the_link(gate)
    take_over(gate)
    gate.run(0.4)
    assert gate.state is GateState.DONE
    restore_the_link(gate)
    gate.run(0.3)
    gate.tell_mode(VehicleMode.POSITION)
    assert (gate.state, gate.last.cause) == (GateState.RELEASED, Cause.TAKEOVER)
    assert not gate.requests


def test_the_old_mode_in_the_socket_of_a_companion_that_stood_still_does_not_count():
    gate = in_servo()
    gate.beat()
    take_over(gate)
    gate.now_ns += 600 * MS
    gate.send([])
    assert gate.state is GateState.ABORT
    for event in (Attitude(gate.now_ns, 0.0, 0.0, 0.0), gate.heartbeat()):
        gate.now_ns += MS
        gate.send([event])
    gate.send([CurrentMode(gate.now_ns, VehicleMode.OFFBOARD)])
    gate.now_ns += 10 * MS
    gate.send([CurrentMode(gate.now_ns, VehicleMode.POSITION)])
    assert not gate.requests


# --- the request that waits -------------------------------------------------------------------


def test_offboard_is_requested_once_the_mode_is_known_again():
    gate = in_engage()
    interrupt_the_link(gate, 0.44)
    gate.run(0.5)
    assert (gate.state, gate.requests) == (GateState.ENGAGE, [])
    gate.tell_mode(VehicleMode.HOLD)
    assert modes_requested(gate) == [ModeRequest.OFFBOARD]


def test_engaging_without_any_message_of_the_mode_ends_with_the_heartbeat():
    gate = in_engage()
    interrupt_the_link(gate, 0.44)
    gate.run(2.0)
    assert (gate.state, gate.last.cause) == (GateState.ABORT, Cause.HEARTBEAT_LOST)
    assert not gate.requests


def test_hold_at_the_goal_is_requested_once_the_mode_is_known_again():
    gate = at_the_goal()
    interrupt_the_link(gate, 0.4)
    gate.run(0.3)
    assert (gate.state, gate.requests) == (GateState.DONE, [])
    gate.tell_mode(VehicleMode.OFFBOARD)
    assert modes_requested(gate) == [ModeRequest.HOLD]
    gate.tell_mode(VehicleMode.HOLD)
    gate.run(3.0)
    assert (gate.state, modes_requested(gate)) == (GateState.DONE, [ModeRequest.HOLD])
    assert gate.machine.is_finished


def test_hold_at_the_goal_that_cannot_be_requested_within_two_seconds_is_an_abort():
    gate = at_the_goal()
    for _ in range(7):  # silences that follow each other: the mode is never known
        interrupt_the_link(gate, 0.24)
        gate.tick()
        gate.beat()
    assert (gate.state, gate.requests) == (GateState.DONE, [])
    gate.run(0.5)
    assert (gate.state, gate.last.cause) == (GateState.ABORT, Cause.HOLD_NOT_CONFIRMED)


def test_another_goal_is_accepted_while_hold_waits_to_be_requested():
    gate = at_the_goal()
    lose_the_link(gate)
    gate.run(0.4)
    assert gate.state is GateState.DONE
    restore_the_link(gate)
    output = gate.command(Action.GOAL, "ab" * 32)
    assert (gate.state, output.refusal) == (GateState.HOLD, "")


def test_hold_after_an_abort_is_not_requested_where_the_mode_becomes_known_too_late():
    gate = in_servo()
    gate.beat()
    lose_the_link(gate)
    gate.until(GateState.ABORT, 0.6)
    restore_the_link(gate)
    gate.run(TIMING.mode_known_ns / 1e9 + 0.02)
    gate.beat()
    assert gate.machine.is_finished
    assert not gate.requests


# --- limits met exactly -----------------------------------------------------------------------


@pytest.mark.parametrize(("more_ns", "asks"), [(0, True), (1, False)])
@pytest.mark.parametrize("kind", [Attitude, LocalPosition])
def test_a_silence_counts_from_just_over_a_fifth_of_a_second_on(kind, more_ns, asks):
    gate = in_servo()
    gate.beat()
    last_ns = gate.machine.vehicle.attitude.t_ns
    gate.now_ns = last_ns + TIMING.link_silent_ns + more_ns
    numbers = (0.0, 0.0, 0.0)
    gate.send(
        [
            kind(gate.now_ns, *numbers)
            if kind is Attitude
            else kind(gate.now_ns, (1.0, 2.0, -3.0), numbers)
        ]
    )
    gate.command(Action.ABORT)
    assert modes_requested(gate) == [ModeRequest.HOLD] * asks


@pytest.mark.parametrize("tell", ["beat", "tell_mode"])
@pytest.mark.parametrize(("more_ns", "asks"), [(0, False), (1, True)])
def test_the_mode_counts_from_just_over_a_fifth_of_a_second_after_the_silence_on(
    tell, more_ns, asks
):
    gate = in_servo()
    gate.beat()
    interrupt_the_link(gate, 0.3)
    gate.tick()
    returned_ns = gate.now_ns
    gate.run(0.18)
    gate.now_ns = returned_ns + TIMING.link_silent_ns + more_ns - MS
    getattr(gate, tell)(mode=VehicleMode.OFFBOARD)
    gate.run(0.1)
    gate.command(Action.ABORT)
    assert modes_requested(gate) == [ModeRequest.HOLD] * asks
