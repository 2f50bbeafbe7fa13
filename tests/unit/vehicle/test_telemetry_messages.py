"""What messages tell of the estimator, of the demand that is flown and of the true motion."""

import math

import pytest
from pymavlink.dialects.v20 import development as mavlink
from vehicle_in_hand import VehicleInHand, setpoint

from dfvs_sim.dynamics.estimate_errors import EstimateGrade

SET_INTERVAL, REQUEST = 511, 512
POSITION_TARGET, ESTIMATOR_STATUS = 85, 230
TRUTH, ORIGIN = mavlink.MAVLINK_MSG_ID_HIL_STATE_QUATERNION, 49
M_PER_LATITUDE, M_PER_LONGITUDE = 111188.0, 75488.0
"""Metres in a degree near 47.4 degrees north at 488 m above the WGS84 ellipsoid."""


def test_the_truth_is_not_streamed_unless_asked_for() -> None:
    vehicle = VehicleInHand(ready_after_s=0.0)
    vehicle.run(2.0)
    assert not vehicle.received("HIL_STATE_QUATERNION")
    assert vehicle.command(SET_INTERVAL, TRUTH, 20_000.0) == [0]
    vehicle.run(2.0)
    assert len(vehicle.received("HIL_STATE_QUATERNION")) == pytest.approx(100, abs=2)


def test_the_truth_is_the_true_motion_and_not_the_estimate() -> None:
    vehicle = VehicleInHand(estimate=EstimateGrade.HIGH)
    vehicle.command(SET_INTERVAL, TRUTH, 20_000.0)
    vehicle.fly_offboard(setpoint(0.8, 0.4), 4.0)
    message, body = vehicle.received("HIL_STATE_QUATERNION")[-1], vehicle.body
    # half a step of 4 ms late at most, then cut off at 1e-7 degree, 1 mm and 1 cm/s
    assert (message.lat * 1e-7 - 47.397742) * M_PER_LATITUDE == pytest.approx(
        body.north_m - 0.005, abs=0.02
    )
    assert (message.lon * 1e-7 - 8.545594) * M_PER_LONGITUDE == pytest.approx(
        body.east_m - 0.004, abs=0.02
    )
    assert message.alt / 1000.0 == pytest.approx(488.0 - body.down_m, abs=0.005)
    assert message.vx == pytest.approx(100.0 * body.v_north_m_s, abs=2.0)
    assert message.vy == pytest.approx(100.0 * body.v_east_m_s, abs=2.0)
    w, x, y, z = message.attitude_quaternion
    yaw = math.atan2(2 * (w * z + x * y), 1 - 2 * (y * y + z * z))
    assert yaw == pytest.approx(body.yaw_rad, abs=0.02)


def test_numbers_of_the_truth_are_cut_off_towards_zero_and_carry_no_time() -> None:
    vehicle = VehicleInHand()
    vehicle.body.v_north_m_s, vehicle.body.v_east_m_s = 0.0197, -0.0197
    message = vehicle.px4.telemetry.build("HIL_STATE_QUATERNION", vehicle.now_ns)
    assert message is not None
    assert (message.vx, message.vy, message.time_usec) == (1, -1, 0)


def test_the_origin_of_the_local_frame_is_told_on_request() -> None:
    vehicle = VehicleInHand()
    assert vehicle.command(REQUEST, ORIGIN) == [0]
    (message,) = vehicle.received("GPS_GLOBAL_ORIGIN")
    assert (message.latitude, message.longitude, message.altitude) == (473977420, 85455940, 488000)


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


def test_the_target_is_the_velocity_within_the_limits_of_px4():
    vehicle = VehicleInHand(parameters={"MPC_XY_VEL_MAX": 0.5, "MPC_Z_VEL_MAX_UP": 0.4})
    vehicle.command(SET_INTERVAL, POSITION_TARGET, 100_000.0)
    vehicle.fly_offboard(setpoint(0.6, 0.8, -0.9), 1.0)
    message = vehicle.received("POSITION_TARGET_LOCAL_NED")[-1]
    assert math.hypot(message.vx, message.vy) == pytest.approx(0.5)
    assert message.vz == pytest.approx(-0.4)


def test_the_estimators_flags_tell_that_the_place_is_lost():
    vehicle = VehicleInHand(parameters={"SYS_FAILURE_EN": 1})
    vehicle.command(SET_INTERVAL, ESTIMATOR_STATUS, 50_000.0)
    vehicle.run(0.2)
    assert vehicle.received("ESTIMATOR_STATUS")[-1].flags == 63
    assert vehicle.command(420, 4.0, 1.0) == [0]  # MAV_CMD_INJECT_FAILURE: GPS off
    vehicle.run(0.2)
    assert vehicle.received("ESTIMATOR_STATUS")[-1].flags == 1 | 4 | 32
