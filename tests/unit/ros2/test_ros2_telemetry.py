"""Telemetry as ROS 2 messages, read back by a ROS library."""

import contextlib

import pytest

from dfvs_common.ros2 import decode, encode
from dfvs_core.errors import ConfigError
from dfvs_service.ros2.cli import main
from dfvs_service.ros2.telemetry import (
    DIAGNOSTICS,
    IMAGE,
    TWIST,
    diagnostics_message,
    preview_message,
    setpoint_message,
)

STAMP_NS = 1_700_000_000_123_456_789
STATE = {
    "state": "HOLD",
    "cause": "frame old: 300 ms",
    "mode": "OFFBOARD",
    "battery": 0.75,
    "distance_m": None,
    "setpoint": [0.1, 0.2, 0.3, 0.4],
}
SERVO = {"error_m": 0.123456789, "error_rad": None, "overlap": 0.5}


def through_the_wire(type_name, message):
    return decode(type_name, encode(type_name, message))


def test_the_setpoint_is_in_ros_axes():
    message = through_the_wire(TWIST, setpoint_message(STATE, STAMP_NS))
    linear, angular = message.twist.linear, message.twist.angular
    # Forward, right, down and clockwise here; forward, left, up and anticlockwise in ROS.
    assert (linear.x, linear.y, linear.z) == (0.1, -0.2, -0.3)
    assert (angular.x, angular.y, angular.z) == (0.0, 0.0, -0.4)
    assert message.header.frame_id == "base_link"
    assert (message.header.stamp.sec, message.header.stamp.nanosec) == divmod(STAMP_NS, 10**9)


@pytest.mark.parametrize(
    ("state", "level"), [("SERVO", 0), ("PREFLIGHT", 1), ("HOLD", 1), ("ABORT", 2), ("NEW", 1)]
)
def test_diagnostics_carry_level_cause_and_what_is_known(state, level):
    made = diagnostics_message("swift", {**STATE, "state": state}, SERVO, STAMP_NS)
    (status,) = through_the_wire(DIAGNOSTICS, made).status
    assert status.level == level
    assert status.name == "dfvs: swift"
    assert status.message == f"{state}: frame old: 300 ms"
    values = {pair.key: pair.value for pair in status.values}
    assert values == {
        "mode": "OFFBOARD",
        "battery": "0.75",
        "error_m": "0.123457",
        "overlap": "0.5",
    }


def test_diagnostics_carry_the_uncertainty_with_the_velocity_error_in_ros_axes():
    known = {"error_spread_m": 0.02, "mounting_score": -7.5, "velocity_error": [0.1, 0.2, 0.3, 0.0]}
    unknown = dict.fromkeys(known)
    (status,) = diagnostics_message("swift", STATE, known, STAMP_NS).status
    (before,) = diagnostics_message("swift", STATE, unknown, STAMP_NS).status
    values = {pair.key: pair.value for pair in status.values}
    kept = {pair.key for pair in before.values}
    assert {key: value for key, value in values.items() if key not in kept} == {
        "error_spread_m": "0.02",
        "mounting_score": "-7.5",
        "velocity_error_forward_m_s": "0.1",
        "velocity_error_left_m_s": "-0.2",
        "velocity_error_up_m_s": "-0.3",
    }


def test_the_preview_is_passed_on_untouched():
    jpeg = b"\xff\xd8\xff any bytes"
    message = through_the_wire(IMAGE, preview_message(jpeg, STAMP_NS))
    assert message.format == "jpeg"
    assert message.data.tobytes() == jpeg


def test_a_vehicle_whose_name_ros_2_does_not_allow_is_refused_at_the_start(refused):
    error = refused(main, "--vehicle", "7", "--set", "zenoh.connect=['tcp/127.0.0.1:1']")
    assert "vehicle name '7' with ROS 2; expected a name that begins with a letter" in error


@pytest.mark.timeout(10)
def test_an_endpoint_of_ros_is_judged_before_any_link_is_waited_for(refused):
    assert "'10.0.0.1:7448'; expected PROTOCOL" in refused(main, "--ros", "10.0.0.1:7448")


def test_telemetry_goes_to_the_ros_domain_of_the_settings(monkeypatch, refused):
    def relay(_vehicle, _sessions, _link, domain):
        raise ConfigError(f"domain {domain}")

    session = contextlib.nullcontext()
    monkeypatch.setattr("dfvs_service.zenoh_session.open_persistently", lambda *_: session)
    monkeypatch.setattr("dfvs_service.ros2.relay.Relay", relay)
    assert "domain 5" in refused(main, "--set", "camera.ros2.domain=5")
