"""How often messages go out, and how that is changed."""

from collections import Counter

import pytest
from pymavlink.dialects.v20 import development as mavlink
from vehicle_in_hand import VehicleInHand

from dfvs_sim.vehicle.messages.streams import COMPANION, Schedule
from dfvs_sim.vehicle.modes import Mode

SET_INTERVAL, GET_INTERVAL, REQUEST = 511, 510, 512
PX4_RATES_HZ = {
    "HEARTBEAT": 1,
    "ATTITUDE": 100,
    "ATTITUDE_QUATERNION": 50,
    "GLOBAL_POSITION_INT": 50,
    "LOCAL_POSITION_NED": 30,
    "ODOMETRY": 30,
    "SYS_STATUS": 5,
    "EXTENDED_SYS_STATE": 5,
    "GPS_RAW_INT": 8,
    "HOME_POSITION": 0.5,
    "BATTERY_STATUS": 0.5,
}


def test_a_companion_gets_px4s_rates() -> None:
    vehicle = VehicleInHand(ready_after_s=0.0)
    vehicle.run(4.0)
    begin_ns = vehicle.now_ns
    vehicle.run(20.0)
    counts = Counter(vehicle.types_sent(COMPANION, begin_ns))
    for name, rate in PX4_RATES_HZ.items():
        # streams run on a grid of 4 ms and keep their own phase: no drift over 20 s
        assert counts[name] == pytest.approx(20 * rate, abs=2), name


def positions_in(vehicle: VehicleInHand, seconds: float) -> int:
    begin_ns = vehicle.now_ns
    vehicle.run(seconds)
    return len(vehicle.received("LOCAL_POSITION_NED", since_ns=begin_ns))


def test_an_interval_is_set_stopped_and_restored() -> None:
    vehicle = VehicleInHand()
    assert vehicle.command(SET_INTERVAL, 32.0, 100_000.0) == [0]
    assert positions_in(vehicle, 5.0) == pytest.approx(50, abs=1)
    vehicle.command(SET_INTERVAL, 32.0, -1.0)
    assert positions_in(vehicle, 2.0) == 0
    vehicle.command(SET_INTERVAL, 32.0, 0.0)
    assert positions_in(vehicle, 5.0) == pytest.approx(150, abs=2)


def test_an_interval_is_told() -> None:
    vehicle = VehicleInHand()
    vehicle.command(GET_INTERVAL, 32.0)
    (told,) = vehicle.received("MESSAGE_INTERVAL")
    assert (told.message_id, told.interval_us) == (32, 33333)


def test_setting_an_interval_on_one_link_leaves_the_other_alone() -> None:
    vehicle = VehicleInHand()
    vehicle.command(SET_INTERVAL, 32.0, -1.0, link="ground")
    assert positions_in(vehicle, 2.0) == pytest.approx(60, abs=1)


def test_an_interval_for_an_unknown_message_fails() -> None:
    assert VehicleInHand().command(SET_INTERVAL, 9999.0, 1000.0) == [4]
    assert VehicleInHand().command(SET_INTERVAL, 32.0, float("nan")) == [4]


def test_a_message_is_sent_on_request() -> None:
    vehicle = VehicleInHand()
    assert vehicle.command(REQUEST, float(mavlink.MAVLINK_MSG_ID_AUTOPILOT_VERSION)) == [0]
    (version,) = vehicle.received("AUTOPILOT_VERSION")
    assert version.flight_sw_version >> 16 == 0x0111  # 1.17
    assert vehicle.command(REQUEST, 9999.0) == [2]


def test_a_message_carries_the_time_of_the_state_and_not_of_its_sending() -> None:
    vehicle = VehicleInHand()
    vehicle.now_ns += 3_000_000  # between two steps of 4 ms
    vehicle.run(1.0)
    stamps = [m.time_boot_ms for m in vehicle.received("ATTITUDE")]
    assert len(stamps) > 50
    assert all(stamp % 4 == 0 for stamp in stamps)


def test_a_late_stream_skips_what_it_missed_and_keeps_its_phase() -> None:
    schedule = Schedule({"ATTITUDE": 100.0}, 0)
    sent = [t for t in range(0, 1000, 1) if t % 25 == 0 and schedule.due(t * 1_000_000)]
    assert len(sent) == 40  # every 25 ms something is due; nothing is sent twice
    assert schedule.due(979 * 1_000_000) == []
    assert schedule.due(980 * 1_000_000) == ["ATTITUDE"]


def test_the_mode_is_told_soon_after_a_change_and_twice_a_second_otherwise() -> None:
    vehicle = VehicleInHand()
    vehicle.command(SET_INTERVAL, float(mavlink.MAVLINK_MSG_ID_CURRENT_MODE), 50_000.0)
    begin_ns = vehicle.now_ns
    vehicle.run(10.0)
    assert len(vehicle.received("CURRENT_MODE", since_ns=begin_ns)) == pytest.approx(20, abs=1)
    for mode in (Mode.OFFBOARD, Mode.POSITION):
        vehicle.run(0.13)
        changed_ns = vehicle.now_ns
        vehicle.px4.request_mode(mode, changed_ns)
        vehicle.run(0.06)
        told = vehicle.received("CURRENT_MODE", since_ns=changed_ns)[0]
        assert told.custom_mode == told.intended_custom_mode == mode.custom_mode
        vehicle.run(0.24)


def test_without_asking_a_change_may_be_told_two_seconds_late() -> None:
    vehicle = VehicleInHand()
    begin_ns = vehicle.now_ns
    vehicle.run(20.0)
    assert len(vehicle.received("CURRENT_MODE", since_ns=begin_ns)) == pytest.approx(10, abs=1)
