import math

import pytest
from hypothesis import given
from hypothesis import strategies as st

from dfvs_core.gate.limits import ZERO, BodyVelocity, VelocityLimits, saturate, slew

LIMITS = VelocityLimits()
speed = st.floats(-50.0, 50.0)
velocities = st.builds(BodyVelocity, speed, speed, speed, speed)
# Scaling by a quotient of floats is exact to a few units in the last place.
ROUNDING = 1.0 + 1e-12


def components(v):
    return (v.forward_m_s, v.right_m_s, v.down_m_s, v.yaw_rad_s)


def assert_within_limits(v):
    assert v.horizontal_m_s <= LIMITS.horizontal_m_s * ROUNDING
    assert abs(v.down_m_s) <= LIMITS.vertical_m_s * ROUNDING
    assert abs(v.yaw_rad_s) <= LIMITS.yaw_rad_s * ROUNDING


@given(velocities)
def test_saturation_keeps_limits_and_direction(v):
    out = saturate(v, LIMITS)
    assert_within_limits(out)
    for a, b in zip(components(v), components(out), strict=True):
        for c, d in zip(components(v), components(out), strict=True):
            # Products up to 50 * 0.5, relative rounding 1e-15.
            assert a * d == pytest.approx(b * c, abs=1e-12)
            assert a * b >= 0.0


@given(velocities)
def test_what_is_within_limits_is_not_changed(v):
    slow = saturate(v, LIMITS).scaled(0.99)
    assert saturate(slow, LIMITS) == slow


def test_the_tightest_axis_scales_all_axes():
    out = saturate(BodyVelocity(0.1, 0.1, 0.6, 0.1), LIMITS)
    assert components(out) == pytest.approx((0.05, 0.05, 0.3, 0.05))


@given(velocities, velocities, st.floats(0.0, 0.2))
def test_slew_bounds_the_change_and_stays_within_limits(a, b, dt_s):
    previous, target = saturate(a, LIMITS), saturate(b, LIMITS)
    out = slew(previous, target, dt_s, LIMITS)
    change = out.plus(previous.scaled(-1.0))
    assert change.speed_m_s <= LIMITS.slew_m_s2 * dt_s + 1e-12
    assert abs(change.yaw_rad_s) <= LIMITS.yaw_slew_rad_s2 * dt_s + 1e-12
    assert_within_limits(out)


def test_slew_reaches_the_target_exactly_in_due_time():
    target = BodyVelocity(0.3, 0.0, 0.1, 0.1)
    velocity = ZERO
    for _ in range(40):
        velocity = slew(velocity, target, 0.02, LIMITS)
    assert velocity == target


def test_slew_needs_the_time_that_the_limit_says():
    target = BodyVelocity(0.5, 0.0, 0.0, 0.0)
    steps, velocity = 0, ZERO
    while velocity != target:
        velocity = slew(velocity, target, 0.02, LIMITS)
        steps += 1
    assert steps in (50, 51)  # 0.5 m/s at 0.5 m/s² is 1 s of 20 ms steps, give or take rounding


@pytest.mark.parametrize("wanted", [(0.3, 0.0, 0.3), (0.0, 0.08, -0.08), (-5.0, 1.0, 0.2)])
def test_the_reduced_speed_bounds_the_length_of_the_linear_velocity(wanted):
    asked = BodyVelocity(*wanted, 0.01)
    reduced = saturate(asked, LIMITS, 0.1)
    assert reduced.speed_m_s == pytest.approx(0.1)
    assert reduced == asked.scaled(0.1 / asked.speed_m_s)


def test_the_reduced_speed_leaves_slow_motion_and_turning_as_they_are():
    slow = BodyVelocity(0.06, 0.0, 0.08, LIMITS.yaw_rad_s)
    assert saturate(slow, LIMITS, 0.1) == slow


@pytest.mark.parametrize("bad", [math.nan, math.inf, -math.inf])
def test_a_velocity_that_is_not_finite_says_so(bad):
    assert not BodyVelocity(0.0, bad, 0.0, 0.0).is_finite()
    assert ZERO.is_finite()


def test_a_sum_adds_every_component():
    total = BodyVelocity(0.1, 0.2, 0.3, 0.4).plus(BodyVelocity(1.0, 2.0, 3.0, 4.0))
    assert components(total) == pytest.approx((1.1, 2.2, 3.3, 4.4))


def test_a_target_within_reach_is_met_to_the_last_bit():
    """-0.05 plus the difference to 0.22 is not 0.22 in floats."""
    target = BodyVelocity(0.22)
    assert slew(BodyVelocity(-0.05), target, 1.0, LIMITS) == target
