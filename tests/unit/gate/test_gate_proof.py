import dataclasses

import pytest
from gate_rehearsal import Rehearsal

from dfvs_core.gate.limits import BodyVelocity
from dfvs_core.gate.proof import MotionProof


def proof(path_m, turn_rad, errors):
    """Proof after a second of motion, with (distance, angle, feature error) triples."""
    out = MotionProof(0)
    out.move(BodyVelocity(path_m, 0.0, 0.0, turn_rad), 1.0)
    report = Rehearsal().report().report
    for error_m, error_rad, feature in errors:
        out.see(
            dataclasses.replace(report, error_m=error_m, error_rad=error_rad, feature_error=feature)
        )
    return out.objection()


def falling(a, b, n=10):
    return [a + (b - a) * i / (n - 1) for i in range(n)]


def triples(distance=(1.0, 1.0), angle=(0.3, 0.3), feature=None):
    features = [None] * 10 if feature is None else falling(*feature)
    return list(zip(falling(*distance), falling(*angle), features, strict=True))


@pytest.mark.parametrize(
    ("path_m", "turn_rad", "errors", "objects_to"),
    [
        (0.08, 0.0, triples(distance=(1.0, 0.95)), None),
        (0.08, 0.0, triples(distance=(1.0, 1.05)), "distance"),
        (0.08, 0.0, triples(), "distance"),
        (0.08, 0.2, triples(distance=(1.0, 0.95)), "angle"),
        (0.0, 0.2, triples(angle=(0.3, 0.2)), None),
        (0.0, 0.2, triples(angle=(0.3, 0.4)), "angle"),
        (0.0, 0.0, triples(distance=(1.0, 1.5), angle=(0.3, 0.5)), None),
        (0.08, 0.2, triples(feature=(0.3, 0.2)), None),
        (0.08, 0.0, triples(distance=(1.0, 0.9), feature=(0.3, 0.31)), "feature"),
        (0.0, 0.2, triples(feature=(0.3, 0.31)), "feature"),
        (0.0, 0.0, triples(feature=(0.3, 0.31)), None),
    ],
)
def test_errors_must_fall_in_what_was_moved(path_m, turn_rad, errors, objects_to):
    objection = proof(path_m, turn_rad, errors)
    assert objection is None if objects_to is None else objects_to in objection


def test_motion_is_speed_times_time():
    out = MotionProof(0)
    for _ in range(50):
        out.move(BodyVelocity(0.06, 0.0, -0.08, -0.2), 0.02)
    assert out.path_m == pytest.approx(0.1)
    assert out.turn_rad == pytest.approx(0.2)


def test_a_single_wild_report_decides_nothing():
    errors = triples(distance=(1.0, 0.95))
    errors[0] = (0.1, 0.3, None)
    errors[-1] = (9.0, 0.3, None)
    assert proof(0.08, 0.0, errors) is None


def test_too_few_reports_prove_nothing():
    assert proof(0.08, 0.0, triples(distance=(1.0, 0.5))[:3]) == "only 3 reports to judge by"


def test_a_feature_error_counts_only_if_every_report_has_it():
    errors = triples(distance=(1.0, 0.95), feature=(0.3, 0.31))
    errors[3] = (errors[3][0], errors[3][1], None)
    assert proof(0.08, 0.0, errors) is None
