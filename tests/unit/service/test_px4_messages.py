import json
import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from vehicle_in_hand import VehicleInHand

from dfvs_common.status_text import plain_text
from dfvs_core.gate.checks.perception_monitor import PerceptionMonitor
from dfvs_core.gate.checks.preflight import preflight
from dfvs_core.gate.config import GateConfig, GateTiming
from dfvs_core.gate.events import CurrentMode, Heartbeat, ModeRequest, VehicleMode
from dfvs_core.gate.limits import BodyVelocity
from dfvs_core.gate.vehicle import VehicleMonitor
from dfvs_core.geometry.poses import quaternion_from_rotation, rotation_from_euler
from dfvs_service.gate import px4
from dfvs_sim.vehicle.messages.streams import COMPANION

T_NS = 42


@pytest.mark.parametrize(
    ("main", "sub", "mode"),
    [
        (6, 0, VehicleMode.OFFBOARD),
        (4, 3, VehicleMode.HOLD),
        (4, 2, VehicleMode.TAKEOFF),
        (4, 5, VehicleMode.RETURN),
        (4, 6, VehicleMode.LAND),
        (4, 4, VehicleMode.MISSION),
        (4, 99, VehicleMode.OTHER),
        (3, 0, VehicleMode.POSITION),
        (3, 1, VehicleMode.OTHER),
        (3, 2, VehicleMode.POSITION),
        (3, 3, VehicleMode.OTHER),
        (2, 0, VehicleMode.ALTITUDE),
        (1, 0, VehicleMode.MANUAL),
        (10, 0, VehicleMode.OTHER),
        (0, 0, VehicleMode.OTHER),
    ],
)
def test_a_heartbeat_tells_the_mode(main, sub, mode):
    fields = {"custom_mode": main << 16 | sub << 24, "base_mode": 145, "system_status": 4}
    assert px4.heartbeat(T_NS, fields).mode is mode


def test_current_mode_tells_the_mode_as_a_heartbeat_does():
    for main, sub, mode in ((6, 0, VehicleMode.OFFBOARD), (4, 3, VehicleMode.HOLD)):
        fields = {"custom_mode": main << 16 | sub << 24, "intended_custom_mode": 0}
        assert px4.current_mode(T_NS, fields) == CurrentMode(T_NS, mode)


@pytest.mark.parametrize(
    ("base_mode", "armed"), [(1, False), (29, False), (145, True), (157, True)]
)
def test_a_heartbeat_tells_whether_the_vehicle_is_armed(base_mode, armed):
    fields = {"custom_mode": 6 << 16, "base_mode": base_mode, "system_status": 4}
    assert px4.heartbeat(T_NS, fields).armed is armed


@pytest.mark.parametrize(("status", "failsafe"), [(3, False), (4, False), (5, True), (8, True)])
def test_a_heartbeat_tells_of_a_failsafe(status, failsafe):
    fields = {"custom_mode": 0, "base_mode": 0, "system_status": status}
    assert px4.heartbeat(T_NS, fields).failsafe is failsafe


angle = st.floats(-3.1, 3.1)


@given(angle, st.floats(-1.5, 1.5), angle)
def test_a_quaternion_becomes_aerospace_angles(roll, pitch, yaw):
    q = quaternion_from_rotation(rotation_from_euler(roll, pitch, yaw))
    event = px4.attitude(T_NS, {f"q{i + 1}": float(v) for i, v in enumerate(q)})
    R = rotation_from_euler(event.roll_rad, event.pitch_rad, event.yaw_rad)
    # Near 90 degrees of pitch the arc sine loses half the digits.
    np.testing.assert_allclose(R, rotation_from_euler(roll, pitch, yaw), atol=1e-6)


@pytest.mark.parametrize("value", [None, "NaN", math.nan, math.inf])
def test_numbers_that_are_none_arrive_as_such(value):
    attitude = px4.attitude(T_NS, {"q1": value, "q2": 0.0, "q3": value, "q4": 0.0})
    assert not math.isfinite(attitude.pitch_rad)
    fields = {**dict.fromkeys(("x", "y", "vx", "vy", "vz"), 1.0), "z": value}
    position = px4.local_position(T_NS, fields)
    assert not math.isfinite(position.position_m[2])
    assert position.velocity_m_s == (1.0, 1.0, 1.0)


@pytest.mark.parametrize(
    ("landed", "in_air", "on_ground"),
    [(0, False, False), (1, False, True), (2, True, False), (3, False, False), (4, False, False)],
)
def test_only_flying_counts_as_in_the_air(landed, in_air, on_ground):
    event = px4.landed_state(T_NS, {"landed_state": landed})
    assert (event.in_air, event.on_ground) == (in_air, on_ground)


def status(battery=80, enabled=0x200007, health=0x10200007):
    """SYS_STATUS as PX4 sends it: the check before arming stands in ``health`` alone."""
    return px4.system_status(
        T_NS,
        {
            "battery_remaining": battery,
            "onboard_control_sensors_enabled": enabled,
            "onboard_control_sensors_health": health,
        },
    )


@pytest.mark.parametrize(
    ("percent", "remaining"), [(80, 0.8), (0, 0.0), (100, 1.0), (-1, None), (255, None)]
)
def test_the_battery_is_a_share_or_unknown(percent, remaining):
    assert status(battery=percent)[0].remaining == remaining


def test_only_what_is_enabled_must_be_healthy():
    assert status()[1].ok
    assert status(enabled=0x3, health=0x3)[1].ok
    sick = status(health=0x10200006)[1]
    assert (sick.ok, sick.detail) == (False, "not healthy: gyroscope")
    assert not sick.only_estimate
    doubted = status(health=0x10000007)[1]
    assert (doubted.ok, doubted.only_estimate) == (False, True)
    assert doubted.detail == "not healthy: attitude and position estimate"
    assert not status(health=0x10000006)[1].only_estimate
    assert not status()[1].only_estimate


@pytest.mark.parametrize("enabled", [0x200007, 0x10200007])
def test_the_checks_before_arming_pass_where_health_says_so_and_nowhere_else(enabled):
    assert status(enabled=enabled)[1].can_arm
    unarmable = status(enabled=enabled, health=0x200007)[1]
    assert unarmable.ok
    assert not unarmable.can_arm


def health_check(vehicle):
    checks = preflight(vehicle, PerceptionMonitor(GateTiming()), GateConfig(), T_NS)
    (health,) = [check for check in checks if check.name == "health"]
    return health


@pytest.mark.parametrize(
    ("fit", "armed", "passes"), [(True, False, True), (False, False, False), (False, True, True)]
)
def test_the_health_check_asks_a_disarmed_vehicle_alone_whether_it_can_be_armed(fit, armed, passes):
    vehicle = VehicleMonitor()
    vehicle.update(Heartbeat(T_NS, VehicleMode.HOLD, armed))
    for event in status(health=0x10200007 if fit else 0x200007):
        vehicle.update(event)
    health = health_check(vehicle)
    assert health.ok is passes
    assert bool(health.detail and health.remedy) is not passes


@pytest.mark.parametrize(("ready_after_s", "passes"), [(0.0, True), (1000.0, False)])
def test_the_stand_in_passes_the_health_check_once_it_can_be_armed(ready_after_s, passes):
    stand_in, heard = VehicleInHand(ready_after_s=ready_after_s), VehicleMonitor()
    stand_in.run(1.5)
    for _, link, message in stand_in.sent:
        if link == COMPANION and message.get_type() == "HEARTBEAT":
            heard.update(px4.heartbeat(T_NS, message.to_dict()))
        if link == COMPANION and message.get_type() == "SYS_STATUS":
            for event in px4.system_status(T_NS, message.to_dict()):
                heard.update(event)
    health = health_check(heard)
    assert health.ok is passes
    assert passes or "before arming" in health.detail


@pytest.mark.parametrize(
    ("flags", "missing"),
    [
        (1 | 2 | 4 | 8, ""),
        (1 | 2 | 4 | 16, ""),
        (2 | 4 | 8, "attitude"),
        (1 | 2 | 4, "horizontal position"),
        (1 | 4 | 16, "horizontal velocity"),
    ],
)
def test_the_estimator_names_what_it_lacks(flags, missing):
    event = px4.estimator_status(T_NS, {"flags": flags})
    assert event.valid is (not missing)
    assert missing in event.detail


@pytest.mark.parametrize(("flags", "is_known"), [(1 | 2 | 4 | 8, False), (1 | 2 | 4 | 16, True)])
def test_a_global_position_is_known_by_its_own_flag(flags, is_known):
    event = px4.estimator_status(T_NS, {"flags": flags})
    assert event.valid
    assert event.has_global_position is is_known


def test_a_setpoint_is_a_body_velocity_with_a_yaw_rate():
    fields = px4.velocity_fields(BodyVelocity(0.1, -0.2, 0.3, 0.4), 7, 5)
    assert (fields["vx"], fields["vy"], fields["vz"]) == (0.1, -0.2, 0.3)
    assert fields["yaw_rate"] == 0.4
    assert (fields["coordinate_frame"], fields["type_mask"]) == (8, 0x5C7)
    assert (fields["target_system"], fields["target_component"]) == (7, 1)
    for name in ("coordinate_frame", "type_mask", "time_boot_ms", "target_system"):
        assert type(fields[name]) is int
    assert json.loads(json.dumps(fields)) == fields


@pytest.mark.parametrize(
    ("request_", "numbers"), [(ModeRequest.OFFBOARD, (6, 0)), (ModeRequest.HOLD, (4, 3))]
)
def test_a_mode_request_never_carries_the_flag_for_arming(request_, numbers):
    fields = px4.mode_fields(request_, 1)
    assert fields["command"] == 176
    assert int(fields["param1"]) & 128 == 0
    assert (fields["param2"], fields["param3"]) == numbers
    assert len([name for name in fields if name.startswith("param")]) == 7


def test_an_interval_is_asked_for_in_microseconds():
    fields = px4.interval_fields(32, 20_000, 1)
    assert (fields["command"], fields["param1"], fields["param2"]) == (511, 32.0, 20_000.0)
    assert px4.answers_interval({"command": fields["command"], "result": 3})
    assert not px4.answers_interval({"command": 176, "result": 0})


@pytest.mark.parametrize(
    ("mask", "is_velocity"),
    [(7 | 0x1C0, True), (7, True), (0, False), (3, False), (7 | 8, False), (7 | 32, False)],
)
def test_a_target_counts_where_a_velocity_is_flown_and_no_position(mask, is_velocity):
    fields = {"type_mask": mask, "vx": 0.1, "vy": -0.2, "vz": None}
    event = px4.velocity_target(T_NS, fields)
    assert (event is not None) is is_velocity
    if event is not None:
        assert event.velocity_m_s[:2] == (0.1, -0.2)
        assert math.isnan(event.velocity_m_s[2])


@pytest.mark.parametrize(
    ("target", "is_ours"),
    [
        ({"target_system": 1}, True),
        ({}, True),
        ({"target_system": 0}, True),
        ({"target_system": 2}, False),
    ],
)
def test_a_foreign_setpoint_names_its_sender(target, is_ours):
    event = px4.foreign_setpoint(T_NS, "SET_ATTITUDE_TARGET", (1, 196), target, 1)
    assert (event is not None) is is_ours
    if event is not None:
        assert event.detail == "SET_ATTITUDE_TARGET of system 1, component 196"


@pytest.mark.parametrize(
    ("text", "plain"),
    [
        ("Takeoff detected\t", "Takeoff detected"),
        ("Preflight Fail:\tno  position\n", "Preflight Fail: no position"),
        ("a\x00b\x1b[2Jc\x7f\x85d", "a b [2Jc d"),
        ("Höhe 3 m", "Höhe 3 m"),
        ("\t", ""),
    ],
)
def test_a_text_of_px4_becomes_one_line_without_control_characters(text, plain):
    assert plain_text(text) == plain
