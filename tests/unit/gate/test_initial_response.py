"""The initial-response check by itself, in one period of SERVO."""

import math

import pytest
from initial_motion import BOTH, STRAIGHT, TIMING, TURN, Motion, errors, noisy, ramp

from dfvs_core.gate.checks.initial_response import InitialResponse, Response

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
