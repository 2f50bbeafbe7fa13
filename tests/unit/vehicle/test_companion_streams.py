"""Streams that a companion may ask for: the estimator's flags and the demand that is flown."""

import math

import pytest
from vehicle_in_hand import VehicleInHand, setpoint

SET_INTERVAL, POSITION_TARGET, ESTIMATOR_STATUS = 511, 85, 230


def test_the_target_is_the_velocity_that_offboard_flies_and_a_place_in_hold():
    vehicle = VehicleInHand()
    vehicle.command(SET_INTERVAL, POSITION_TARGET, 100_000.0)
    vehicle.fly_offboard(setpoint(0.3, 0.0, -0.1, 0.2), 1.0)
    message = vehicle.received("POSITION_TARGET_LOCAL_NED")[-1]
    assert message.type_mask & 0b111111 == 0b000111
    assert message.type_mask & 1 << 10
    assert not message.type_mask & 1 << 11
    assert math.hypot(message.vx, message.vy) == pytest.approx(0.3)
    assert message.vz == pytest.approx(-0.1)
    assert message.yaw_rate == pytest.approx(0.2)
    vehicle.run(2.0)  # no setpoints: the failsafe holds the place
    assert vehicle.received("POSITION_TARGET_LOCAL_NED")[-1].type_mask & 0b111 == 0


def test_the_estimators_flags_tell_that_the_place_is_lost():
    vehicle = VehicleInHand(parameters={"SYS_FAILURE_EN": 1})
    vehicle.command(SET_INTERVAL, ESTIMATOR_STATUS, 50_000.0)
    vehicle.run(0.2)
    assert vehicle.received("ESTIMATOR_STATUS")[-1].flags == 63
    assert vehicle.command(420, 4.0, 1.0) == [0]  # MAV_CMD_INJECT_FAILURE: GPS off
    vehicle.run(0.2)
    assert vehicle.received("ESTIMATOR_STATUS")[-1].flags == 1 | 4 | 32
