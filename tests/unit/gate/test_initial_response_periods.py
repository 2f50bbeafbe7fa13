"""The initial-response check over several periods of SERVO, and the motion that it counts."""

import math

import pytest
from initial_motion import BOTH, STEP_NS, TIMING, TURN, Motion, errors, noisy

from dfvs_core.gate.checks.initial_response import InitialResponse, Response
from dfvs_core.gate.config import MS, S
from dfvs_core.gate.limits import BodyVelocity


def holding(motion, seconds=3.0, turn_rad=0.0):
    """Let a HOLD pass, in which the vehicle may turn."""
    motion.now_ns += round(seconds * S)
    motion.yaw_rad += turn_rad
    motion.check.resume(motion.now_ns)
    return motion


def test_the_time_limit_counts_the_time_in_servo_over_all_periods():
    motion = holding(holding(Motion().run(2.52)).run(2.52))
    # A period lasts until its last setpoint: 2.5 s each.
    assert motion.check.evaluate(motion.now_ns + S - 1, TIMING) is Response.OPEN
    assert motion.check.evaluate(motion.now_ns + S, TIMING) is Response.FAILED


def test_a_period_without_a_setpoint_lasts_no_time():
    motion = holding(Motion().see(), seconds=30.0)
    assert motion.check.earlier_ns == 0


def test_periods_shorter_than_the_least_time_fail_as_well():
    motion = Motion()
    for _ in range(12):
        holding(motion.run(0.52))
    assert motion.judge() is Response.FAILED


def test_falls_within_the_periods_add_up_and_a_rise_in_the_hold_does_not_count():
    motion = holding(Motion().run(5.0).see(errors(distance=(1.0, 0.985))))
    assert motion.judge() is Response.OPEN
    motion.see(errors(distance=(3.0, 2.985))).run(1.02)
    assert motion.judge() is Response.CONFIRMED


@pytest.mark.parametrize(
    ("first", "second"),
    [
        ({}, {}),
        ({"distance": (1.0, 1.05)}, {"distance": (0.5, 0.47)}),
        ({"distance": (1.0, 0.97)}, {"distance": (0.5, 0.55)}),
        ({"feature": (0.5, 0.55)}, {"feature": (0.3, 0.27)}),
    ],
)
def test_a_fall_in_the_hold_confirms_nothing(first, second):
    motion = holding(Motion().run(3.0).see(errors(**({"distance": (1.0, 1.0)} | first))))
    motion.see(errors(**({"distance": (0.5, 0.5)} | second))).run(1.02)
    assert motion.judge() is Response.OPEN
    assert motion.run(2.1).judge() is Response.FAILED


@pytest.mark.parametrize(
    ("asked", "more"), [(TURN, {"angle": (0.3, 0.28)}), (TURN, {"feature": (0.3, 0.28)})]
)
def test_angle_and_feature_error_of_an_earlier_period_count(asked, more):
    motion = holding(Motion().run(1.5, asked).see(errors(**more))).see(errors(feature=(0.3, 0.3)))
    assert motion.run(1.02, asked).judge() is Response.CONFIRMED


@pytest.mark.parametrize("periods", [1, 2, 3])
@pytest.mark.parametrize(("share", "is_confirmed"), [(1.001, True), (0.999, False)])
def test_the_noise_of_the_periods_adds_up_in_squares(periods, share, is_confirmed):
    least = 4.0 * 0.01 / (0.6745 * math.sqrt(2.0)) * 1.25 * math.sqrt(2.0 / 5.0)
    values = noisy(share * least / math.sqrt(periods) + 0.01)
    motion = Motion().run(1.0)
    for k in range(periods):
        motion = (holding(motion) if k else motion).see([(v, 0.3, None) for v in values])
    assert motion.run(1.02).judge() is (Response.CONFIRMED if is_confirmed else Response.OPEN)


def test_a_feature_error_counts_only_if_every_report_of_every_period_has_it():
    falling = errors(distance=(1.0, 1.05), feature=(0.3, 0.2))
    lacking = [(1.0, 0.3, None)] * 10
    for reports in ((falling, lacking), (lacking, falling)):
        motion = holding(Motion().run(1.5).see(reports[0])).see(reports[1]).run(1.02)
        assert motion.judge() is Response.OPEN


def test_what_an_earlier_period_has_shown_confirms_only_after_the_least_time():
    motion = holding(Motion().run(5.9).see(errors(distance=(1.0, 0.9)), score=3.0)).run(0.98)
    assert motion.judge() is Response.OPEN  # and has not failed, although 6 s are over
    assert motion.run(0.04).judge() is Response.CONFIRMED


def test_a_mounting_known_from_an_earlier_period_counts():
    motion = holding(Motion().run(1.5).see(score=4.0).see(score=5.0)).run(1.02)
    assert motion.judge() is Response.CONFIRMED


def test_motion_counts_over_all_periods_and_that_in_a_hold_does_not():
    motion = holding(Motion().run(0.42, BOTH), turn_rad=1.0).run(0.42, BOTH)
    assert motion.check.followed_m == pytest.approx(0.08)
    assert motion.check.followed_rad == pytest.approx(0.16)
    assert motion.check.asked_m == pytest.approx((0.08, 0.0, 0.0))


# --- motion ---------------------------------------------------------------------------------


@pytest.mark.parametrize("yaw_rad", [0.0, 2.0, 3.1, -1.5])
def test_motion_counts_in_the_direction_that_was_asked_for(yaw_rad):
    motion = Motion(yaw_rad).run(1.02, (0.06, 0.0, -0.08, 0.3), share=0.5)
    # The vehicle turns meanwhile, but the law asks anew in its body frame at every step.
    assert motion.check.followed_m == pytest.approx(0.05, rel=1e-6)
    assert motion.check.followed_rad == pytest.approx(0.15, rel=1e-6)


def test_where_nothing_was_asked_for_nothing_was_followed():
    check = InitialResponse(0, moved_m=(1.0, 0.0, 0.0), turned_rad=1.0)
    assert (check.followed_m, check.followed_rad) == (0.0, 0.0)


def test_what_was_asked_and_flown_is_counted_in_the_body_frame():
    check = InitialResponse(0)
    own = (0.3, 0.0, 0.1), math.pi / 2  # heads east, drifts north: to its left
    for t_ns in (0, 50 * MS):
        check.integrate(BodyVelocity(0.1, 0.2, 0.3, 0.4), *own, t_ns)
    assert check.asked_m == pytest.approx((0.005, 0.01, 0.015))
    assert check.asked_rad == pytest.approx(0.02)
    assert check.moved_m == pytest.approx((0.0, -0.015, 0.005))


def test_a_pause_counts_for_a_tenth_of_a_second_at_most():
    check = InitialResponse(0)
    for now_ns in (0, 5 * S):
        check.integrate(BodyVelocity(0.1), (0.1, 0.0, 0.0), 0.0, now_ns)
    assert check.followed_m == pytest.approx(0.01)


def test_a_turn_across_south_is_a_small_one():
    motion = Motion(yaw_rad=3.1).run(0.52, (0.0, 0.0, 0.0, 0.2))
    assert motion.check.followed_rad == pytest.approx(0.1)
    check = InitialResponse(0)
    for i, yaw in enumerate((3.1, -3.1)):
        check.integrate(BodyVelocity(0, 0, 0, 0.1), (0, 0, 0), yaw, i * STEP_NS)
    assert check.turned_rad == pytest.approx(math.tau - 6.2)
