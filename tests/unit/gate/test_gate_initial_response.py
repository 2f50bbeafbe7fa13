"""The initial-response check by itself, and what the gate does by it."""

import dataclasses
import math

import pytest
from gate_rehearsal import TICK_NS, Rehearsal, auto_config

from dfvs_core.gate.checks.initial_response import InitialResponse, Response
from dfvs_core.gate.config import MS, GateTiming, S
from dfvs_core.gate.events import Action, BadReport
from dfvs_core.gate.limits import ZERO, BodyVelocity
from dfvs_core.gate.states import Cause, GateState

TIMING = GateTiming()
STEP_NS = 20 * MS

STRAIGHT = (0.1, 0.0, 0.0, 0.0)
TURN = (0.0, 0.0, 0.0, -0.2)
BOTH = (0.1, 0.0, 0.0, 0.2)
"""Velocities that are asked for: forward, right, down in m/s, yaw rate in rad/s."""


class Motion:
    """A check that is followed at 50 Hz by a vehicle at a heading."""

    def __init__(self, yaw_rad=0.0):
        self.check = InitialResponse(0)
        self.now_ns = 0
        self.yaw_rad = yaw_rad

    def run(self, seconds, asked=STRAIGHT, share=1.0):
        """Ask for a velocity; the vehicle flies a share of it."""
        for _ in range(round(seconds * S / STEP_NS)):
            f, r, d, w = (share * v for v in asked)
            c, s = math.cos(self.yaw_rad), math.sin(self.yaw_rad)
            own = (c * f - s * r, s * f + c * r, d), self.yaw_rad
            self.check.integrate(BodyVelocity(*asked), *own, self.now_ns)
            self.now_ns += STEP_NS
            self.yaw_rad += w * STEP_NS / S
        return self

    def see(self, errors=((1.0, 0.3, None),), score=None):
        report = Rehearsal().report(mounting_score=score).report
        for error_m, error_rad, feature in errors:
            self.check.update(
                dataclasses.replace(
                    report, error_m=error_m, error_rad=error_rad, feature_error=feature
                )
            )
        return self

    def judge(self):
        return self.check.evaluate(self.now_ns, TIMING)


def ramp(a, b, n=10):
    return [a + (b - a) * i / (n - 1) for i in range(n)]


def errors(distance=(1.0, 1.0), angle=(0.3, 0.3), feature=None):
    """Ten reports' errors, each linear from a first to a last value."""
    features = [None] * 10 if feature is None else ramp(*feature)
    return list(zip(ramp(*distance), ramp(*angle), features, strict=True))


# --- mounting -------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("score", "shown"), [(5.0, Response.CONFIRMED), (math.nextafter(5.0, 0.0), Response.OPEN)]
)
def test_a_right_mounting_confirms_exactly_when_the_least_time_is_over(score, shown):
    """Although no error has fallen."""
    motion = Motion().see(score=score)
    motion.now_ns = TIMING.response_ns - 1
    assert motion.judge() is Response.OPEN
    motion.now_ns += 1
    assert motion.judge() is shown


def test_a_right_mounting_confirms_where_the_time_limit_is_over_as_well():
    motion = Motion().run(6.2).see(score=5.0)
    assert motion.judge() is Response.CONFIRMED


@pytest.mark.parametrize(("score", "shown"), [(5.0, "CONFIRMED"), (4.9, "OPEN")])
def test_a_score_that_was_high_enough_counts_later_too(score, shown):
    """Once it was, perception asks for no more tilt, and forgets."""
    motion = Motion().see(score=-4.0).see(score=score).see(score=4.0).see(score=None)
    motion.now_ns = TIMING.response_ns
    assert motion.judge() is Response[shown]


@pytest.mark.parametrize("score", [4.9, 0.0, -2.0, -4.9])
def test_a_falling_error_confirms_nothing_while_the_mounting_may_still_be_told(score):
    motion = Motion().run(3.0).see(errors(distance=(1.0, 0.9)), score=score)
    motion.now_ns = TIMING.response_limit_ns - 1
    assert motion.judge() is Response.OPEN


@pytest.mark.parametrize(
    ("score", "shown"),
    [
        (4.9, Response.CONFIRMED),
        (-2.0, Response.CONFIRMED),
        (math.nextafter(-2.0, -3.0), Response.FAILED),
        (-4.9, Response.FAILED),
    ],
)
def test_at_the_time_limit_a_falling_error_confirms_a_mounting_that_is_not_doubtful(score, shown):
    motion = Motion().run(3.0).see(errors(distance=(1.0, 0.9)), score=score)
    motion.now_ns = TIMING.response_limit_ns
    assert motion.judge() is shown


# --- errors ---------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("asked", "reports", "is_confirmed"),
    [
        (STRAIGHT, errors(distance=(1.0, 0.95)), True),
        (STRAIGHT, errors(distance=(1.0, 1.05)), False),
        (STRAIGHT, errors(), False),
        (STRAIGHT, errors(angle=(0.3, 0.2)), False),
        (TURN, errors(angle=(0.3, 0.2)), True),
        (TURN, errors(angle=(0.3, 0.4)), False),
        (TURN, errors(distance=(1.0, 0.5)), False),
        (BOTH, errors(distance=(1.0, 0.95), angle=(0.3, 0.4)), True),
        (BOTH, errors(distance=(1.0, 1.05), angle=(0.3, 0.2)), True),
        (BOTH, errors(distance=(1.0, 1.05), angle=(0.3, 0.4)), False),
        (STRAIGHT, errors(distance=(1.0, 1.2), feature=(0.3, 0.29)), True),
        (TURN, errors(angle=(0.3, 0.4), feature=(0.3, 0.29)), True),
        (STRAIGHT, errors(distance=(1.0, 0.9), feature=(0.3, 0.31)), True),
        (TURN, errors(angle=(0.3, 0.2), feature=(0.3, 0.31)), True),
        (STRAIGHT, errors(distance=(1.0, 1.05), feature=(0.3, 0.31)), False),
    ],
)
def test_the_feature_error_or_the_error_of_the_motion_must_fall(asked, reports, is_confirmed):
    motion = Motion().run(1.2, asked).see(reports)
    assert motion.judge() is (Response.CONFIRMED if is_confirmed else Response.OPEN)


@pytest.mark.parametrize(
    ("moved", "reports"),
    [
        ({"moved_m": (0.03, 0.0, 0.0)}, errors(distance=(1.0, 0.9))),
        ({"turned_rad": 0.05}, errors(angle=(0.3, 0.2))),
        ({"moved_m": (0.03, 0.0, 0.0)}, errors(feature=(0.3, 0.2))),
        ({"turned_rad": 0.05}, errors(feature=(0.3, 0.2))),
    ],
)
def test_a_fall_counts_from_exactly_the_least_motion_on(moved, reports):
    (name, value) = next(iter(moved.items()))
    less = (0.0299, 0.0, 0.0) if name == "moved_m" else 0.0499
    for motion, shown in ((value, Response.CONFIRMED), (less, Response.OPEN)):
        check = InitialResponse(0, asked_m=(1.0, 0.0, 0.0), asked_rad=1.0, **{name: motion})
        check.errors.extend(reports)
        assert check.evaluate(TIMING.response_ns, TIMING) is shown


def test_a_fall_confirms_exactly_when_the_least_time_is_over():
    motion = Motion().run(1.0).see(errors(distance=(1.0, 0.9)))
    motion.now_ns = TIMING.response_ns - 1
    assert motion.judge() is Response.OPEN
    motion.now_ns += 1
    assert motion.judge() is Response.CONFIRMED


def noisy(fall, flutter=0.01):
    """Ten errors whose medians of five fall, with equal steps up and down between reports."""
    up = [flutter * (i % 2) for i in range(5)]
    return [1.0 + v for v in up] + [1.0 + flutter - fall - v for v in up]


@pytest.mark.parametrize(("share", "is_confirmed"), [(1.001, True), (0.999, False)])
def test_a_fall_must_be_four_standard_deviations_of_two_medians(share, is_confirmed):
    # Steps of d between reports: noise d / (0.6745 sqrt 2); two medians of five, each 1.25/sqrt 5.
    least = 4.0 * 0.01 / (0.6745 * math.sqrt(2.0)) * 1.25 * math.sqrt(2.0 / 5.0)
    values = noisy(share * least + 0.01)  # the later flutter goes the other way: medians differ
    motion = Motion().run(1.0).see([(v, 0.3, None) for v in values])
    assert motion.judge() is (Response.CONFIRMED if is_confirmed else Response.OPEN)


def test_a_single_wild_report_decides_nothing():
    reports = [(distance, 0.3, None) for distance in ramp(1.0, 0.95, 20)]
    reports[0], reports[-1] = (0.1, 0.3, None), (9.0, 0.3, None)
    assert Motion().run(1.2).see(reports).judge() is Response.CONFIRMED


@pytest.mark.parametrize(("count", "is_confirmed"), [(3, False), (4, True)])
def test_four_reports_are_just_enough(count, is_confirmed):
    reports = [(distance, 0.3, None) for distance in (1.0, 1.0, 0.5, 0.5)[-count:]]
    assert (Motion().run(1.2).see(reports).judge() is Response.CONFIRMED) is is_confirmed


def test_half_of_few_reports_is_compared_with_the_other_half():
    distances = (1.0, 1.01, 1.0, 1.01, 0.85, 0.86, 0.85, 0.86)
    motion = Motion().run(1.2).see([(d, 0.3, None) for d in distances])
    # Medians of four, 1.005 and 0.855; of five each they would share reports.
    assert motion.judge() is Response.CONFIRMED


def test_of_more_reports_the_last_five_are_compared_with_the_first_five():
    distances = [1.0 + 0.01 * (i % 2) for i in range(15)] + [0.8] * 5
    assert Motion().run(1.2).see([(d, 0.3, None) for d in distances]).judge() is Response.CONFIRMED


def test_a_feature_error_counts_only_if_every_report_has_it():
    reports = errors(distance=(1.0, 1.05), feature=(0.3, 0.2))
    assert Motion().run(1.2).see(reports).judge() is Response.CONFIRMED
    reports[3] = (reports[3][0], reports[3][1], None)
    assert Motion().run(1.2).see(reports).judge() is Response.OPEN


def test_of_many_reports_the_first_five_and_the_last_are_kept():
    motion = Motion().see([(float(i), 0.0, None) for i in range(400)])
    kept = [e[0] for e in motion.check.errors]
    assert len(kept) == 300
    assert kept[:6] == [0.0, 1.0, 2.0, 3.0, 4.0, 105.0]
    assert kept[-1] == 399.0


# --- time limit -----------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("asked", "fails"),
    [
        ({"asked_m": (0.06, 0.0, 0.08)}, True),
        ({"asked_m": (0.0999, 0.0, 0.0)}, False),
        ({"asked_rad": -0.15}, True),
        ({"asked_rad": 0.15}, True),
        ({"asked_rad": -0.1499}, False),
    ],
)
def test_a_missing_response_fails_if_enough_was_asked_for(asked, fails):
    check = InitialResponse(0, **asked)
    assert check.evaluate(TIMING.response_limit_ns - 1, TIMING) is Response.OPEN
    shown = check.evaluate(TIMING.response_limit_ns, TIMING)
    assert shown is (Response.FAILED if fails else Response.OPEN)


def test_a_missing_response_says_what_was_asked_for_and_what_was_done():
    motion = Motion().run(6.2, BOTH, share=0.5).see(errors())
    assert motion.judge() is Response.FAILED
    # The body turns meanwhile, but the motion counts in its own frame.
    assert motion.check.objection == (
        "the vehicle moved 0.31 m and 0.62 rad of 0.62 m and 1.24 rad"
    )


@pytest.mark.parametrize("asked", [STRAIGHT, TURN])
def test_motion_the_other_way_confirms_nothing(asked):
    falling = errors(distance=(1.0, 0.5), angle=(0.3, 0.1), feature=(0.3, 0.1))
    motion = Motion().run(5.9, asked, share=-1.0).see(falling)
    assert motion.judge() is Response.OPEN
    assert motion.run(0.2, asked, share=-1.0).judge() is Response.FAILED
    assert " -" in motion.check.objection


def test_asking_to_and_fro_is_asking_for_nothing():
    motion = Motion()
    for _ in range(40):
        motion.run(0.1, share=0.0).run(0.1, (-0.1, 0.0, 0.0, 0.0), share=0.0)
    assert motion.judge() is Response.OPEN


# --- HOLD -----------------------------------------------------------------------------------


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


# --- the gate -------------------------------------------------------------------------------


def speeds(gate):
    return [v.speed_m_s for _, v in gate.setpoints]


def test_the_first_second_is_flown_at_reduced_speed():
    gate = Rehearsal(auto_config()).until(GateState.SERVO).forget()
    gate.run(1.0)
    end_ns = gate.machine.since_ns + TIMING.response_ns
    first = [v.speed_m_s for t, v in gate.setpoints if t < end_ns]
    assert max(first) == pytest.approx(0.1)
    gate.run(2.0)
    assert speeds(gate)[-1] == pytest.approx(0.4)


def test_a_mounting_known_to_be_right_does_not_shorten_it():
    gate = Rehearsal(auto_config(), changes={"mounting_score": 50.0}, fall_m_s=0.0)
    gate.until(GateState.SERVO).forget().run(0.98)
    assert max(speeds(gate)) <= 0.1 + 1e-12
    gate.run(1.0)
    assert max(speeds(gate)) > 0.3


@pytest.mark.parametrize("fall_m_s", [-0.15, -0.01, 0.0])
def test_an_error_that_does_not_fall_aborts_after_six_seconds(fall_m_s):
    gate = Rehearsal(auto_config(), error_m=2.0, fall_m_s=fall_m_s).until(GateState.SERVO)
    start_ns = gate.now_ns
    gate.until(GateState.ABORT)
    assert gate.last.cause is Cause.ERROR_NOT_FALLING
    assert gate.now_ns - start_ns == TIMING.response_limit_ns
    assert max(speeds(gate)) <= 0.1 + 1e-12


@pytest.mark.parametrize("score", [-6.0, -99.0])
def test_a_wrong_mounting_aborts_in_the_step_that_tells_of_it(score):
    gate = Rehearsal(auto_config()).until(GateState.SERVO).run(0.3)
    assert gate.moved()
    output = gate.look(mounting_score=score)
    assert (gate.state, gate.last.cause) == (GateState.ABORT, Cause.WRONG_MOUNTING)
    assert output.setpoint == ZERO


def test_once_confirmed_a_wrong_mounting_ends_the_flight_as_well():
    gate = Rehearsal(auto_config()).until(GateState.SERVO).run(1.5)
    gate.look(mounting_score=-5.0)
    assert gate.state is GateState.ABORT
    assert gate.last.cause is Cause.WRONG_MOUNTING
    assert gate.last.detail == "5 standard deviations; is it mounted as camera.mount says?"


@pytest.mark.parametrize("age_ms", [201, 240])
def test_a_late_result_shows_nothing_of_the_mounting(age_ms):
    gate = Rehearsal(auto_config()).until(GateState.SERVO).run(0.3)
    gate.sees = False
    gate.run(0.1)
    seen_ns = gate.machine.perception.last_capture_ns
    gate.now_ns = seen_ns + MS + age_ms * MS
    gate.send([gate.report(mounting_score=-9.0, t_capture_ns=seen_ns + MS)])
    assert gate.state is GateState.SERVO
    assert gate.machine.perception.last_capture_ns == seen_ns


def test_a_repeated_frame_is_one_observation():
    gate = Rehearsal(auto_config()).until(GateState.SERVO).run(0.3)
    seen = len(gate.machine._engagement.response.errors)
    for _ in range(5):
        gate.now_ns += MS
        gate.send([gate.report(t_capture_ns=gate.machine.perception.last_capture_ns)])
    assert len(gate.machine._engagement.response.errors) == seen > 0


def test_a_vehicle_that_answers_late_is_waited_for_at_reduced_speed():
    gate = Rehearsal(auto_config(), fall_m_s=0.0)
    gate.vehicle.follows = 0.0
    gate.until(GateState.SERVO).run(2.5)
    assert gate.state is GateState.SERVO
    assert speeds(gate)[-1] == pytest.approx(0.1)
    gate.vehicle.follows = 1.0
    gate.fall_m_s = 0.1
    gate.run(3.0)
    assert gate.state is GateState.SERVO
    assert max(speeds(gate)[-5:]) > 0.3


@pytest.mark.parametrize("follows", [0.0, -1.0])
def test_a_vehicle_that_does_not_follow_aborts_after_six_seconds(follows):
    gate = Rehearsal(auto_config())
    gate.vehicle.follows = follows
    gate.until(GateState.SERVO)
    start_ns = gate.now_ns
    gate.until(GateState.ABORT)
    assert gate.last.cause is Cause.ERROR_NOT_FALLING
    assert "the vehicle moved" in gate.last.detail
    assert TIMING.response_limit_ns <= gate.now_ns - start_ns <= TIMING.response_limit_ns + TICK_NS


def test_after_a_hold_the_least_time_begins_anew():
    gate = Rehearsal(auto_config()).until(GateState.SERVO).run(0.8)
    gate.send([gate.report(healthy=False)])
    gate.until(GateState.SERVO).forget().run(0.98)
    assert max(speeds(gate)) <= 0.1 + 1e-12


def with_holds(gate, servo_s, seconds):
    """Fly on, with an unhealthy report after each ``servo_s`` in SERVO; returns the time in it."""
    end_ns, flown_ns, period_ns = gate.now_ns + round(seconds * S), 0, 0
    while gate.state in (GateState.SERVO, GateState.HOLD) and gate.now_ns < end_ns:
        if gate.state is GateState.SERVO:
            flown_ns, period_ns = flown_ns + TICK_NS, period_ns + TICK_NS
        if period_ns >= round(servo_s * S):
            period_ns = 0
            gate.tick(gate.report(healthy=False, reason="too little"))
        else:
            gate.tick()
    return flown_ns / S


@pytest.mark.parametrize("servo_s", [0.5, 0.98, 2.5, 4.5, 5.5])
def test_holds_do_not_put_off_the_end_of_a_flight_whose_error_does_not_fall(servo_s):
    gate = Rehearsal(auto_config(), error_m=2.0, fall_m_s=-0.1).until(GateState.SERVO)
    flown_s = with_holds(gate, servo_s, 60.0)
    assert (gate.state, gate.last.cause) == (GateState.ABORT, Cause.ERROR_NOT_FALLING)
    assert flown_s == pytest.approx(6.0, abs=0.3)


@pytest.mark.parametrize("servo_s", [0.5, 0.98, 2.0])
def test_an_error_that_falls_in_servo_and_rises_in_holds_ends_no_flight(servo_s):
    """A vehicle drifts while zeros are sent."""
    gate = Rehearsal(auto_config(), error_m=5.0, fall_m_s=0.1).until(GateState.SERVO)
    for _ in range(8):
        with_holds(gate, servo_s, 0.01 + servo_s)
        gate.error_m += 0.5
        gate.until(GateState.SERVO, 2.5)
    gate.run(1.5)
    assert gate.state is GateState.SERVO
    assert speeds(gate)[-1] > 0.3  # confirmed


def test_a_commanded_hold_does_not_put_it_off_either():
    gate = Rehearsal(auto_config(), error_m=2.0, fall_m_s=-0.1).until(GateState.SERVO).run(4.0)
    gate.command(Action.HOLD)
    gate.run(20.0)
    gate.command(Action.ENGAGE)
    gate.until(GateState.SERVO).until(GateState.ABORT, 2.2)
    assert gate.last.cause is Cause.ERROR_NOT_FALLING


def test_another_goal_and_another_engagement_begin_with_a_check_of_their_own():
    gate = Rehearsal(auto_config(), error_m=2.0, fall_m_s=-0.1).until(GateState.SERVO).run(4.0)
    gate.command(Action.HOLD)
    gate.command(Action.GOAL, "ab" * 32)
    gate.command(Action.ENGAGE)
    gate.until(GateState.SERVO)
    assert with_holds(gate, 99.0, 9.0) == pytest.approx(6.0, abs=0.1)
    assert gate.last.cause is Cause.ERROR_NOT_FALLING
    gate.run(2.0)
    gate.command(Action.ENGAGE)
    gate.until(GateState.SERVO)
    assert with_holds(gate, 99.0, 9.0) == pytest.approx(6.0, abs=0.1)


def test_once_confirmed_a_hold_does_not_ask_for_it_again():
    gate = Rehearsal(auto_config()).until(GateState.SERVO).run(2.0)
    gate.send([gate.report(healthy=False)])
    gate.until(GateState.SERVO).forget().run(0.9)
    assert max(speeds(gate)) > 0.3


@pytest.mark.parametrize(("response_ns", "speed_m_s"), [(0, 0.4), (1, 0.1)])
def test_without_a_time_for_it_no_check_is_made(response_ns, speed_m_s):
    config = auto_config(timing=dataclasses.replace(TIMING, response_ns=response_ns))
    gate = Rehearsal(config, fall_m_s=0.0)
    gate.vehicle.follows = 0.0  # and so shows no response
    gate.until(GateState.SERVO).run(1.5)
    assert speeds(gate)[-1] == pytest.approx(speed_m_s)


def test_an_error_within_tolerance_need_not_fall():
    """A vehicle that starts at its goal and is asked to stay there against its own drift."""
    config = auto_config(timing=dataclasses.replace(TIMING, reached_ns=9 * S))
    gate = Rehearsal(config, fall_m_s=0.0, asked=(0.03, 0.0, 0.0, 0.0))
    gate.changes = {"reached": True}
    gate.until(GateState.SERVO).run(8.0)
    assert gate.state is GateState.SERVO
    gate.changes = {"reached": False}
    gate.tick()
    assert (gate.state, gate.last.cause) == (GateState.ABORT, Cause.ERROR_NOT_FALLING)


def test_a_wrong_mounting_aborts_within_tolerance_as_well():
    gate = Rehearsal(auto_config(), changes={"reached": True}).until(GateState.SERVO).run(0.5)
    gate.look(reached=True, mounting_score=-6.0)
    assert (gate.state, gate.last.cause) == (GateState.ABORT, Cause.WRONG_MOUNTING)


def test_a_bad_report_is_no_observation():
    gate = Rehearsal(auto_config()).until(GateState.SERVO).run(0.3)
    gate.send([BadReport(gate.now_ns, "not JSON"), gate.report(mounting_score=-9.0)])
    assert gate.state is GateState.HOLD


# --- a route --------------------------------------------------------------------------------


def at_first_goal(**changes):
    """A gate in SERVO within tolerance of the first of two goals."""
    gate = Rehearsal(auto_config(), fall_m_s=0.0, error_m=0.02, **changes)
    gate.changes = {"goals_left": 1, "reached": True}
    return gate.until(GateState.SERVO)


def test_within_tolerance_of_a_goal_on_the_way_an_error_need_not_fall_and_nothing_is_reached():
    gate = at_first_goal(asked=(0.03, 0.0, 0.0, 0.0)).run(9.0)
    assert gate.state is GateState.SERVO
    gate.changes = {"goals_left": 1}
    gate.tick()
    assert (gate.state, gate.last.cause) == (GateState.ABORT, Cause.ERROR_NOT_FALLING)


def test_the_last_goal_is_reached_after_a_second_of_its_own():
    gate = at_first_goal().run(3.0)
    gate.changes["goals_left"] = 0
    gate.run(0.96)
    assert gate.state is GateState.SERVO
    gate.until(GateState.DONE, 0.1)


@pytest.mark.parametrize("asked", [(0.0, 0.0, 0.0, 0.0), (0.0, -0.05, 0.0, 0.0)])
@pytest.mark.parametrize("held", [False, True])
@pytest.mark.parametrize(("fall_m_s", "state"), [(0.1, "SERVO"), (0.0, "ABORT")])
def test_the_error_of_the_next_goal_is_not_compared_with_that_of_the_last(
    asked, held, fall_m_s, state
):
    gate = at_first_goal(asked=asked).run(8.0)
    if held:
        gate.send([gate.report(healthy=False)])
    gate.changes, gate.error_m, gate.fall_m_s = {}, 1.0, fall_m_s
    gate.asked = (0.4, 0.0, 0.0, 0.0)
    gate.run(4.0)
    assert gate.state is GateState(state)
    if state == "SERVO":
        assert speeds(gate)[-1] == pytest.approx(0.4)  # confirmed
    else:
        assert gate.last.cause is Cause.ERROR_NOT_FALLING
        assert max(speeds(gate)) <= 0.1 + 1e-12


def test_a_change_of_goal_adds_to_time_and_falls_and_begins_the_motion_anew():
    motion = Motion().run(5.02).see(errors(distance=(1.0, 0.985)))
    motion.check.change_goal(0, motion.now_ns)
    assert (motion.check.asked_m, motion.check.moved_m) == ((0.0, 0.0, 0.0),) * 2
    motion.see(errors(distance=(3.0, 2.985))).run(1.02)
    assert motion.check.followed_m == pytest.approx(0.1)
    assert motion.judge() is Response.CONFIRMED


def test_a_change_of_goal_begins_the_turn_anew():
    motion = Motion().run(5.02, TURN)
    motion.check.change_goal(0, motion.now_ns)
    assert motion.check.evaluate(motion.now_ns + S, TIMING) is Response.OPEN
    assert motion.check.followed_rad == 0.0
    assert motion.run(1.02, TURN).check.followed_rad == pytest.approx(0.2)
    assert motion.judge() is Response.FAILED
