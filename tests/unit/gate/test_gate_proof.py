import dataclasses
import math

import pytest
from gate_rehearsal import Rehearsal

from dfvs_core.gate.config import MS, GateTiming, S
from dfvs_core.gate.limits import BodyVelocity
from dfvs_core.gate.proof import MotionProof, OwnMotion, Proof
from dfvs_core.gate.states import Cause

TIMING = GateTiming()
STEP_NS = 20 * MS


class Rehearsed:
    """A proof that is followed at 50 Hz by a vehicle at a heading."""

    def __init__(self, yaw_rad=0.0):
        self.proof = MotionProof(0)
        self.now_ns = 0
        self.yaw_rad = yaw_rad

    def run(self, seconds, asked=(0.1, 0.0, 0.0, 0.0), share=1.0):
        """Ask for a velocity; the vehicle flies a share of it."""
        for _ in range(round(seconds * S / STEP_NS)):
            f, r, d, w = (share * v for v in asked)
            c, s = math.cos(self.yaw_rad), math.sin(self.yaw_rad)
            own = OwnMotion((c * f - s * r, s * f + c * r, d), self.yaw_rad)
            self.proof.follow(BodyVelocity(*asked), own, self.now_ns)
            self.now_ns += STEP_NS
            self.yaw_rad += w * STEP_NS / S
        return self

    def see(self, errors):
        report = Rehearsal().report().report
        for error_m, error_rad, feature in errors:
            self.proof.see(
                dataclasses.replace(
                    report, error_m=error_m, error_rad=error_rad, feature_error=feature
                )
            )
        return self

    def judge(self):
        return self.proof.judge(self.now_ns, TIMING)


def falling(a, b, n=10):
    return [a + (b - a) * i / (n - 1) for i in range(n)]


def triples(distance=(1.0, 1.0), angle=(0.3, 0.3), feature=None):
    features = [None] * 10 if feature is None else falling(*feature)
    return list(zip(falling(*distance), falling(*angle), features, strict=True))


STRAIGHT = (0.1, 0.0, 0.0, 0.0)
TURN = (0.0, 0.0, 0.0, -0.2)
BOTH = (0.1, 0.0, 0.0, 0.2)


@pytest.mark.parametrize(
    ("asked", "errors", "objects_to"),
    [
        (STRAIGHT, triples(distance=(1.0, 0.95)), None),
        (STRAIGHT, triples(distance=(1.0, 1.05)), "distance"),
        (STRAIGHT, triples(), "distance"),
        (BOTH, triples(distance=(1.0, 0.95)), "angle"),
        (TURN, triples(angle=(0.3, 0.2)), None),
        (TURN, triples(angle=(0.3, 0.4)), "angle"),
        (BOTH, triples(feature=(0.3, 0.2)), None),
        (STRAIGHT, triples(distance=(1.0, 1.2), feature=(0.3, 0.29)), None),
        (STRAIGHT, triples(distance=(0.98, 0.95), feature=(0.64, 0.66)), None),
        (STRAIGHT, triples(distance=(1.0, 1.05), feature=(0.3, 0.31)), "feature"),
        (BOTH, triples(distance=(1.0, 0.9), feature=(0.3, 0.31)), "feature"),
        (TURN, triples(feature=(0.3, 0.31)), "feature"),
        (TURN, triples(angle=(0.3, 0.2), feature=(0.3, 0.31)), None),
    ],
)
def test_errors_must_fall_in_what_was_moved(asked, errors, objects_to):
    rehearsed = Rehearsed().run(1.2, asked).see(errors)
    assert rehearsed.judge() is (Proof.GIVEN if objects_to is None else Proof.FAILED)
    assert (objects_to or "") in rehearsed.proof.objection
    assert bool(rehearsed.proof.objection) is (objects_to is not None)


@pytest.mark.parametrize("yaw_rad", [0.0, 2.0, 3.1, -1.5])
def test_motion_counts_in_the_direction_that_was_asked_for(yaw_rad):
    rehearsed = Rehearsed(yaw_rad).run(1.02, (0.06, 0.0, -0.08, 0.3), share=0.5)
    # The vehicle turns meanwhile, but the law asks anew in its body frame at every step.
    assert rehearsed.proof.followed_m == pytest.approx(0.05, rel=1e-6)
    assert rehearsed.proof.followed_rad == pytest.approx(0.15, rel=1e-6)


@pytest.mark.parametrize("asked", [STRAIGHT, TURN])
def test_motion_the_other_way_is_no_beginning(asked):
    rehearsed = Rehearsed().run(2.9, asked, share=-1.0).see(triples(distance=(1.0, 0.5)))
    assert rehearsed.judge() is Proof.OPEN
    assert rehearsed.run(0.2, asked, share=-1.0).judge() is Proof.FAILED
    assert " -0." in rehearsed.proof.objection


def test_a_pause_counts_for_a_tenth_of_a_second_at_most():
    proof = MotionProof(0)
    for now_ns in (0, 5 * S):
        proof.follow(BodyVelocity(0.1), OwnMotion((0.1, 0.0, 0.0), 0.0), now_ns)
    assert proof.followed_m == pytest.approx(0.01)


def test_the_error_has_its_time_from_the_first_motion_on():
    rehearsed = Rehearsed().run(2.0, share=0.0).see(triples())
    assert rehearsed.proof.begun_ns is None
    rehearsed.run(0.14)
    begun_ns = rehearsed.proof.begun_ns
    # Half a centimetre at 0.1 m/s, the step between the two runs included.
    assert begun_ns == 2040 * MS
    rehearsed.now_ns = begun_ns
    rehearsed.run(0.6)
    rehearsed.now_ns -= 1
    assert rehearsed.judge() is Proof.OPEN
    assert not rehearsed.proof._is_doubted
    rehearsed.now_ns += 1
    assert rehearsed.judge() is Proof.OPEN
    assert rehearsed.proof._is_doubted
    rehearsed.run(0.12)
    rehearsed.now_ns -= 1
    assert rehearsed.judge() is Proof.OPEN
    rehearsed.now_ns += 1
    assert rehearsed.judge() is Proof.FAILED


def test_an_error_that_has_fallen_late_is_enough():
    rehearsed = Rehearsed().run(0.72).see(triples())
    assert rehearsed.judge() is Proof.OPEN
    rehearsed.see(triples(distance=(1.0, 0.9))).run(0.02)
    assert rehearsed.judge() is Proof.OPEN  # it is looked at twice, and not in between
    assert rehearsed.proof.objection == ""
    rehearsed.run(0.13)
    assert rehearsed.judge() is Proof.GIVEN
    assert rehearsed.proof.objection == ""


def test_at_the_first_look_a_fall_is_enough():
    assert Rehearsed().run(0.7).see(triples(distance=(1.0, 0.9))).judge() is Proof.GIVEN


def test_a_step_of_centimetres_shows_nothing_yet():
    rehearsed = Rehearsed().run(2.0, (0.01, 0.0, 0.0, 0.0)).see(triples())
    assert rehearsed.proof.begun_ns is not None
    assert rehearsed.judge() is Proof.OPEN
    assert rehearsed.run(1.2, (0.01, 0.0, 0.0, 0.0)).judge() is Proof.FAILED


def test_who_is_asked_for_nothing_need_not_begin():
    rehearsed = Rehearsed().run(10.0, (0.009, 0.0, 0.0, 0.014), share=0.0)
    assert rehearsed.judge() is Proof.OPEN
    for asked in ((0.011, 0.0, 0.0, 0.0), (0.0, 0.0, 0.0, 0.016)):
        assert Rehearsed().run(10.0, asked, share=0.0).judge() is Proof.FAILED


def test_asking_to_and_fro_is_asking_for_nothing():
    rehearsed = Rehearsed()
    for _ in range(30):
        rehearsed.run(0.1, share=0.0).run(0.1, (-0.1, 0.0, 0.0, 0.0), share=0.0)
    assert rehearsed.judge() is Proof.OPEN


def test_a_turn_across_south_is_a_small_one():
    rehearsed = Rehearsed(yaw_rad=3.1).run(0.52, (0.0, 0.0, 0.0, 0.2))
    assert rehearsed.proof.followed_rad == pytest.approx(0.1)
    proof = MotionProof(0)
    for i, yaw in enumerate((3.1, -3.1)):
        proof.follow(BodyVelocity(0, 0, 0, 0.1), OwnMotion((0, 0, 0), yaw), i * STEP_NS)
    assert proof.turned_rad == pytest.approx(math.tau - 6.2)


def test_a_single_wild_report_decides_nothing():
    errors = triples(distance=(1.0, 0.95))
    errors[0] = (0.1, 0.3, None)
    errors[-1] = (9.0, 0.3, None)
    assert Rehearsed().run(1.2).see(errors).judge() is Proof.GIVEN


def test_too_few_reports_prove_nothing():
    rehearsed = Rehearsed().run(1.2).see(triples(distance=(1.0, 0.5))[:3])
    assert rehearsed.judge() is Proof.FAILED
    assert rehearsed.proof.objection == "only 3 reports to judge by"


def test_a_feature_error_counts_only_if_every_report_has_it():
    errors = triples(distance=(1.0, 1.05), feature=(0.3, 0.29))
    assert Rehearsed().run(1.2).see(errors).judge() is Proof.GIVEN
    errors[3] = (errors[3][0], errors[3][1], None)
    assert Rehearsed().run(1.2).see(errors).judge() is Proof.FAILED


def with_courses(rehearsed, *courses, errors=(1.0, 0.3, 0.3)):
    """Reports of a camera whose course is the vehicle's own to that extent."""
    report = Rehearsal().report().report
    names = ("error_m", "error_rad", "feature_error")
    seen = dict(zip(names, errors, strict=True))
    for course in courses:
        rehearsed.proof.see(dataclasses.replace(report, **seen, course_agreement=course))
    return rehearsed


def test_a_course_of_its_own_is_not_waited_for():
    rehearsed = with_courses(Rehearsed(), -1.0, -1.0, None, -1.0, None, -1.0)
    assert rehearsed.judge() is Proof.OPEN  # it has not moved yet
    rehearsed = with_courses(Rehearsed().run(0.2), -1.0, -1.0, None, -1.0, None)
    assert rehearsed.judge() is Proof.OPEN
    with_courses(rehearsed, -1.0)
    assert rehearsed.judge() is Proof.FAILED
    assert rehearsed.proof.cause is Cause.OTHER_COURSE
    assert rehearsed.proof.objection.startswith("180° from where the vehicle says it goes")


def test_errors_that_fall_do_not_excuse_another_course():
    """A camera mounted backwards levels its pictures the wrong way: errors may fall with that."""
    fallen = Rehearsed().run(0.6).see(triples(distance=(1.0, 0.9), feature=(0.3, 0.2)))
    assert with_courses(fallen, *[-0.9] * 4, errors=(0.9, 0.3, 0.2)).judge() is Proof.FAILED


def test_a_single_other_course_is_enough_to_doubt():
    fallen = Rehearsed().run(0.6).see(triples(feature=(0.3, 0.2)))
    assert with_courses(fallen, -1.0, errors=(1.0, 0.3, 0.2)).judge() is Proof.OPEN
    fallen.run(0.2).see(triples(feature=(0.2, 0.2)))
    assert fallen.judge() is Proof.FAILED
    assert fallen.proof.cause is Cause.OTHER_COURSE
    assert with_courses(fallen, 1.0, 1.0, errors=(1.0, 0.3, 0.2)).judge() is Proof.GIVEN


@pytest.mark.parametrize(
    ("courses", "is_another"),
    [
        ((0.3, 0.3, 0.3, 0.3), True),
        ((0.301, 0.301, 0.301, 0.301), False),
        ((1.0, 1.0, 1.0, -1.0, -1.0), False),
        ((1.0, 1.0, 1.0, -1.0, -1.0, -1.0), True),
        ((-1.0, -1.0, -1.0, 1.0, 1.0, 1.0), False),
    ],
)
def test_the_middle_one_of_the_last_five_courses_counts(courses, is_another):
    rehearsed = with_courses(Rehearsed().run(0.2), *courses)
    assert rehearsed.judge() is (Proof.FAILED if is_another else Proof.OPEN)


def test_the_right_course_alone_proves_nothing():
    rehearsed = with_courses(Rehearsed().run(0.8), *[1.0] * 10)
    assert rehearsed.judge() is Proof.FAILED
    assert rehearsed.proof.cause is Cause.ERROR_NOT_FALLING
