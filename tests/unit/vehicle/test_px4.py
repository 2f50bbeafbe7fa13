"""The vehicle's face towards MAVLink: arming, modes, acks, texts, landing, commands."""

import math
from typing import Any

import pytest
from pymavlink.dialects.v20 import development as mavlink
from vehicle_in_hand import (
    ARM,
    LAND,
    SET_MODE,
    START_NS,
    TAKEOFF,
    VehicleInHand,
    hovering,
    in_offboard,
    setpoint,
    sticks,
)

from dfvs_sim.vehicle.messages.streams import COMPANION, GROUND
from dfvs_sim.vehicle.modes import Mode

NAN = math.nan
ACCELEROMETER = float(mavlink.FAILURE_UNIT_SENSOR_ACCEL)
SET_INTERVAL = mavlink.MAV_CMD_SET_MESSAGE_INTERVAL
WRONG = float(mavlink.FAILURE_TYPE_WRONG)
MAVLINK_SIGNAL = float(mavlink.FAILURE_UNIT_SYSTEM_MAVLINK_SIGNAL)


def test_heartbeat_shows_not_armable_then_standby_then_active() -> None:
    vehicle = VehicleInHand()
    vehicle.run(6.1)
    vehicle.command(ARM, 1.0)
    vehicle.run(1.1)
    heartbeats = vehicle.received("HEARTBEAT")
    told = [(heartbeats[i].base_mode, heartbeats[i].system_status) for i in (0, 6, 7)]
    assert told == [(29, 0), (29, 3), (157, 4)]
    assert {m.custom_mode for m in heartbeats} == {Mode.HOLD.custom_mode}


def test_it_cannot_be_armed_before_it_is_ready() -> None:
    vehicle = VehicleInHand(ready_after_s=5.0)
    vehicle.run(4.0)
    assert vehicle.command(ARM, 1.0) == [1]
    vehicle.run(1.2)
    assert vehicle.command(ARM, 1.0) == [0]


def test_home_position_and_prearm_health_alone_come_with_readiness() -> None:
    vehicle = VehicleInHand(ready_after_s=2.0)
    vehicle.run(1.8)
    assert not vehicle.received("HOME_POSITION")
    vehicle.run(3.0)
    assert vehicle.received("HOME_POSITION")
    bit = mavlink.MAV_SYS_STATUS_PREARM_CHECK
    told = vehicle.received("SYS_STATUS")
    assert not any(m.onboard_control_sensors_present & bit for m in told)
    assert not any(m.onboard_control_sensors_enabled & bit for m in told)
    assert not told[0].onboard_control_sensors_health & bit
    assert told[-1].onboard_control_sensors_health & bit


def _readiness_told(vehicle: VehicleInHand, message: Any = None) -> tuple[bool, int]:
    """Prearm health and the heartbeat's system status, once a message came for a while."""
    vehicle.run(1.2, message)
    health = vehicle.received("SYS_STATUS")[-1].onboard_control_sensors_health
    return (
        bool(health & mavlink.MAV_SYS_STATUS_PREARM_CHECK),
        vehicle.received("HEARTBEAT")[-1].system_status,
    )


def test_in_offboard_on_the_ground_it_is_ready_to_arm_only_with_setpoints() -> None:
    vehicle = VehicleInHand()
    vehicle.run(2.0)
    vehicle.set_mode(Mode.OFFBOARD)
    assert _readiness_told(vehicle) == (False, 0)
    assert _readiness_told(vehicle, setpoint()) == (True, 3)


@pytest.mark.parametrize("mode", [Mode.POSITION, Mode.LAND, Mode.RETURN])
def test_in_a_mode_that_cannot_be_armed_it_is_not_ready_and_refuses(mode: Mode) -> None:
    vehicle = VehicleInHand()
    vehicle.run(2.0)
    vehicle.set_mode(mode)
    assert _readiness_told(vehicle) == (False, 0)
    assert vehicle.command(ARM, 1.0) == [1]
    vehicle.set_mode(Mode.HOLD)
    assert _readiness_told(vehicle) == (True, 3)


def test_mode_changes_while_disarmed_are_always_accepted() -> None:
    vehicle = VehicleInHand()
    vehicle.run(6.0)
    for mode in (Mode.OFFBOARD, Mode.POSITION, Mode.MISSION, Mode.LAND, Mode.HOLD):
        assert vehicle.set_mode(mode) == [0, 0]
        assert vehicle.mode is mode


def test_position_mode_needs_sticks_once_armed() -> None:
    vehicle = hovering()
    assert vehicle.set_mode(Mode.POSITION) == [0, 1]
    vehicle.run(0.1, sticks())
    assert vehicle.set_mode(Mode.POSITION) == [0, 0]
    vehicle.run(2.0, sticks())
    assert vehicle.mode is Mode.POSITION
    vehicle.run(1.0)  # sticks fall silent
    assert vehicle.mode is Mode.RETURN


def test_without_a_position_the_loss_of_sticks_ends_in_a_landing() -> None:
    vehicle = hovering()
    vehicle.run(0.1, sticks())
    vehicle.set_mode(Mode.POSITION)
    vehicle.px4.flight.estimate.valid = False
    vehicle.run(1.0)  # sticks fall silent
    assert vehicle.mode is Mode.LAND


def test_sticks_fly_it_in_position_mode() -> None:
    vehicle = hovering()
    vehicle.run(0.1, sticks())
    vehicle.set_mode(Mode.POSITION)
    vehicle.run(3.0, sticks(forward=0.1))
    assert vehicle.body.v_north_m_s == pytest.approx(1.0, abs=0.15)
    vehicle.run(4.0, sticks())
    assert abs(vehicle.body.v_north_m_s) < 0.05


def test_a_pilot_takes_over_from_offboard_while_setpoints_go_on() -> None:
    vehicle = in_offboard(setpoint(vx=0.5), 2.0)
    vehicle.send(sticks(), GROUND)
    vehicle.send(
        mavlink.MAVLink_command_long_message(1, 1, SET_MODE, 0, 1, 3, 0, 0, 0, 0, 0), GROUND
    )
    for _ in range(75):
        vehicle.send(sticks(), GROUND)
        vehicle.run(0.04, setpoint(vx=0.5))
    assert vehicle.mode is Mode.POSITION
    assert abs(vehicle.body.v_north_m_s) < 0.05


def test_a_command_or_mode_that_does_not_exist_is_refused() -> None:
    vehicle = VehicleInHand()
    assert vehicle.command(31010) == [3]
    assert vehicle.command(SET_MODE, 1.0, 4.0, 77.0) == [0, 1]
    assert vehicle.command(SET_MODE, NAN, NAN, NAN) == [0, 1]


def test_disarming_in_the_air_is_refused_unless_forced() -> None:
    vehicle = hovering()
    vehicle.hear_ground_station()
    assert vehicle.command(ARM, 0.0) == [1]
    assert vehicle.received("STATUSTEXT", GROUND)[-1].text == "Disarming denied: not landed"
    assert vehicle.px4.status.armed
    assert vehicle.command(ARM, 0.0, 21196.0) == [0]
    assert not vehicle.px4.status.armed


def test_it_disarms_10_s_after_arming_without_take_off() -> None:
    vehicle = VehicleInHand()
    vehicle.run(6.0)
    vehicle.command(ARM, 1.0)
    seconds = vehicle.run_until(lambda: not vehicle.px4.status.armed, 12.0)
    assert seconds == pytest.approx(10.0, abs=0.15)


def test_take_off_climbs_to_the_altitude_above_sea_level_and_then_holds() -> None:
    vehicle = hovering()
    vehicle.run(5.0)
    assert vehicle.mode is Mode.HOLD
    assert vehicle.px4.config.ground_m - vehicle.body.down_m == pytest.approx(3.0, abs=0.05)
    assert math.hypot(vehicle.body.north_m, vehicle.body.east_m) < 0.05


def test_take_off_without_an_altitude_uses_the_parameter() -> None:
    vehicle = VehicleInHand(parameters={"MIS_TAKEOFF_ALT": 1.5})
    vehicle.run(6.0)
    vehicle.command(ARM, 1.0)
    vehicle.command(TAKEOFF, *[NAN] * 7)
    vehicle.run(15.0)
    assert vehicle.px4.config.ground_m - vehicle.body.down_m == pytest.approx(1.5, abs=0.05)


def test_landing_from_5_m_takes_about_14_s_and_ends_disarmed() -> None:
    vehicle = hovering(height_m=5.0)
    assert vehicle.command(LAND) == [0]
    seconds = vehicle.run_until(lambda: not vehicle.px4.status.armed, 20.0)
    assert seconds == pytest.approx(14.0, abs=1.5)
    times = {f["cause"]: t for t, kind, f in vehicle.record if kind == "state"}
    wait_s = (times["disarmed: on the ground"] - times["landed"]) / 1e9
    assert 2.0 <= wait_s <= 3.0
    assert vehicle.mode is Mode.HOLD  # the last one that can be armed is selected again
    assert vehicle.command(ARM, 1.0) == [0]


def test_after_a_landing_from_offboard_it_shows_offboard_and_cannot_be_armed() -> None:
    vehicle = in_offboard(setpoint(), 1.0)
    vehicle.command(LAND)
    vehicle.run_until(lambda: not vehicle.px4.status.armed, 20.0)
    assert vehicle.mode is Mode.OFFBOARD
    assert vehicle.command(ARM, 1.0) == [1]
    vehicle.set_mode(Mode.HOLD)
    assert vehicle.command(ARM, 1.0) == [0]


def test_return_flies_home_and_lands_there() -> None:
    vehicle = in_offboard(setpoint(vx=1.0, vy=0.5), 6.0)
    assert math.hypot(vehicle.body.north_m, vehicle.body.east_m) > 4.0
    vehicle.set_mode(Mode.RETURN)
    vehicle.run_until(lambda: not vehicle.px4.status.armed, 60.0)
    assert math.hypot(vehicle.body.north_m, vehicle.body.east_m) < 0.5


def test_hold_stops_and_keeps_the_place() -> None:
    vehicle = in_offboard(setpoint(vx=1.0), 4.0, wind_east_m_s=1.0)
    vehicle.set_mode(Mode.HOLD)
    vehicle.run(6.0)
    here = vehicle.body.north_m, vehicle.body.east_m
    vehicle.run(6.0)
    there = vehicle.body.north_m, vehicle.body.east_m
    assert math.dist(here, there) < 0.1


def test_local_z_is_not_zero_on_the_ground() -> None:
    vehicle = VehicleInHand()
    vehicle.run(1.0)
    z = [m.z for m in vehicle.received("LOCAL_POSITION_NED")]
    assert min(z) == max(z) != 0.0


def test_texts_go_only_to_links_with_a_ground_stations_heartbeat() -> None:
    vehicle = VehicleInHand()
    vehicle.send(mavlink.MAVLink_heartbeat_message(18, 8, 0, 0, 4, 3))  # the companion's
    vehicle.command(ARM, 1.0)
    assert not vehicle.received("STATUSTEXT", GROUND)
    vehicle.hear_ground_station()
    vehicle.command(ARM, 1.0)
    assert vehicle.received("STATUSTEXT", GROUND)
    assert not vehicle.received("STATUSTEXT")


def test_acks_go_to_the_link_and_sender_of_the_command() -> None:
    vehicle = VehicleInHand()
    command = mavlink.MAVLink_command_long_message(1, 1, SET_MODE, 0, 1, 4, 3, 0, 0, 0, 0)
    (first,) = vehicle.send(command, GROUND, component=190)
    assert (first.target_system, first.target_component) == (1, 190)
    vehicle.run(0.02)
    assert len(vehicle.received("COMMAND_ACK", GROUND)) == 1
    assert not vehicle.received("COMMAND_ACK")


def test_messages_for_another_vehicle_are_not_heard() -> None:
    vehicle = VehicleInHand()
    other = mavlink.MAVLink_command_long_message(2, 1, ARM, 0, 1, 0, 0, 0, 0, 0, 0)
    assert vehicle.send(other) == []


def test_ping_and_timesync_are_answered() -> None:
    vehicle = VehicleInHand()
    (pong,) = vehicle.send(mavlink.MAVLink_ping_message(77, 5, 0, 0))
    assert (pong.time_usec, pong.seq, pong.target_component) == (77, 5, 195)
    vehicle.run(1.0)
    (sync,) = vehicle.send(mavlink.MAVLink_timesync_message(0, 123))
    assert (sync.tc1, sync.ts1) == (vehicle.now_ns - START_NS, 123)  # the clock of all stamps
    assert vehicle.received("ATTITUDE")[-1].time_boot_ms == pytest.approx(sync.tc1 / 1e6, abs=20)


def test_home_is_where_it_was_armed() -> None:
    vehicle = hovering(ground_m=0.3)
    home = vehicle.received("HOME_POSITION")[-1]
    assert home.z == pytest.approx(0.3)
    assert home.altitude == pytest.approx(1000 * (488.0 - 0.3), abs=1)
    vehicle.run(0.5, setpoint())
    vehicle.set_mode(Mode.OFFBOARD)
    vehicle.run(3.0, setpoint(vx=1.0))
    vehicle.command(LAND)
    vehicle.run_until(lambda: not vehicle.px4.status.armed, 30.0)
    vehicle.set_mode(Mode.HOLD)
    assert vehicle.command(ARM, 1.0) == [0]
    assert vehicle.px4.status.home_m[0] == pytest.approx(vehicle.body.north_m, abs=0.01)
    assert vehicle.body.north_m > 1.0


@pytest.mark.parametrize(
    ("unit", "kind", "name"), [(100, 1, "battery"), (4, 1, "estimate"), (4, 4, "jump")]
)
def test_faults_are_injected_only_where_enabled(unit: int, kind: int, name: str) -> None:
    vehicle = hovering()
    assert vehicle.command(420, unit, kind, 0.0) == [2]
    vehicle = hovering(parameters={"SYS_FAILURE_EN": 1})
    before = vehicle.px4.flight.estimate.north_m
    assert vehicle.command(420, unit, kind, 0.0) == [0]
    vehicle.run(0.2)
    if name == "battery":
        left = [m.battery_remaining for m in vehicle.received("SYS_STATUS")]
        assert (left[0], left[-1]) == (100, 4)
    elif name == "estimate":
        assert vehicle.mode is Mode.LAND
        assert vehicle.px4.status.system_status() == 5
    else:
        assert vehicle.px4.flight.estimate.north_m - before > 1.5


def test_a_warning_about_the_estimate_clears_its_bit_and_nothing_else() -> None:
    vehicle = hovering(parameters={"SYS_FAILURE_EN": 1})
    vehicle.command(SET_INTERVAL, mavlink.MAVLINK_MSG_ID_ESTIMATOR_STATUS, 50_000.0)
    vehicle.run(0.5)
    sound = vehicle.received("SYS_STATUS")[-1].onboard_control_sensors_health
    flags = vehicle.received("ESTIMATOR_STATUS")[-1].flags
    assert vehicle.command(420, ACCELEROMETER, WRONG, 0.0) == [0]
    vehicle.run(0.5)
    told = vehicle.received("SYS_STATUS")[-1]
    assert sound & ~told.onboard_control_sensors_health == mavlink.MAV_SYS_STATUS_AHRS
    assert told.onboard_control_sensors_enabled & mavlink.MAV_SYS_STATUS_AHRS
    assert vehicle.received("ESTIMATOR_STATUS")[-1].flags == flags
    assert vehicle.mode is Mode.HOLD
    assert vehicle.command(420, ACCELEROMETER, 0.0, 0.0) == [0]
    vehicle.run(0.5)
    assert vehicle.received("SYS_STATUS")[-1].onboard_control_sensors_health == sound


def test_a_dropped_link_is_silent_both_ways_until_mended_over_the_other() -> None:
    vehicle = VehicleInHand(parameters={"SYS_FAILURE_EN": 1})
    vehicle.run(1.0)
    assert vehicle.command(420, MAVLINK_SIGNAL, 1.0, 1.0, link=GROUND) == [0]
    begin = vehicle.now_ns
    vehicle.run(1.0, setpoint())
    assert vehicle.types_sent(COMPANION, begin) == []
    assert not [kind for _, kind, _ in vehicle.record if kind == "setpoint"]
    vehicle.command(420, MAVLINK_SIGNAL, 0.0, 1.0, link=GROUND)
    begin = vehicle.now_ns
    vehicle.run(1.0)
    assert vehicle.received("HEARTBEAT", since_ns=begin)


def test_mode_and_arm_commands_are_recorded_with_their_sender() -> None:
    vehicle = VehicleInHand()
    vehicle.run(6.0)
    vehicle.command(ARM, 1.0, link=GROUND)
    vehicle.set_mode(Mode.OFFBOARD)
    arm = [f for _, kind, f in vehicle.record if kind == "arm_command"]
    mode = [f for _, kind, f in vehicle.record if kind == "mode_command"]
    assert [(f["link"], f["result"]) for f in arm] == [(GROUND, 0)]
    assert [(f["link"], f["mode"], f["result"]) for f in mode] == [(COMPANION, "OFFBOARD", 1)]


def test_a_stall_of_the_loop_is_made_up_for_in_fixed_steps() -> None:
    smooth, stalled = VehicleInHand(), VehicleInHand()
    for vehicle in (smooth, stalled):
        vehicle.fly_offboard(setpoint(vx=0.5), 2.0)
    smooth.run(0.4)
    stalled.now_ns += 400_000_000
    stalled.px4.step(stalled.now_ns)
    assert stalled.body.north_m == smooth.body.north_m
