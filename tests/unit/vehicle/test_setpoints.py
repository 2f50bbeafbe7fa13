"""What PX4 takes from SET_POSITION_TARGET_LOCAL_NED."""

import math

import pytest

from dfvs_sim.vehicle.motion.setpoints import (
    BODY_NED,
    LOCAL_NED,
    Setpoint,
    demand_from_setpoint,
)

NAN = math.nan
ZERO = (0.0, 0.0, 0.0)


def setpoint(frame: int, mask: int, velocity: tuple[float, float, float]) -> Setpoint:
    return Setpoint(frame, mask, (7.0, 8.0, 9.0), velocity, ZERO, 0.5, 0.25)


def test_body_velocity_is_turned_by_the_yaw_on_arrival() -> None:
    demand = demand_from_setpoint(setpoint(BODY_NED, 0x5C7, (1.0, 0.0, 0.3)), math.pi / 2)
    assert demand is not None
    assert demand.velocity == pytest.approx((0.0, 1.0, 0.3))


def test_body_velocity_with_yaw_rate_takes_nothing_else() -> None:
    demand = demand_from_setpoint(setpoint(BODY_NED, 0x5C7, ZERO), 0.0)
    assert demand is not None
    assert demand.yaw_rate_rad_s == 0.25
    assert math.isnan(demand.yaw_rad)
    assert all(math.isnan(v) for v in (*demand.position, *demand.acceleration))


def test_ned_velocity_with_yaw_is_not_turned() -> None:
    demand = demand_from_setpoint(setpoint(LOCAL_NED, 0x9C7, (1.0, 2.0, 3.0)), 1.0)
    assert demand is not None
    assert demand.velocity == (1.0, 2.0, 3.0)
    assert demand.yaw_rad == 0.5
    assert math.isnan(demand.yaw_rate_rad_s)
