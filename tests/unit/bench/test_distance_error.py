"""Which frames of simulated flights the error of the distance is measured in."""

import numpy as np
import pytest
from still_pipeline import servo_result

from dfvs_bench.lockstep.flight import LockstepLog, Sample
from dfvs_bench.lockstep.record import simulated_flight, summarise
from dfvs_core.geometry.poses import make_pose
from dfvs_core.servo.exchange import Uncertainty


def flight(length_m):
    """A straight flight in steps of 10 cm, whose distance is estimated a tenth too long."""
    samples = []
    for way_m in np.arange(0.0, length_m + 0.01, 0.1):
        left_m = length_m - way_m + 0.05
        stated = Uncertainty(0.2 * left_m, 0.1, np.zeros(4), 0.03, left_m, 0.01)
        result = servo_result(error_m=1.1 * left_m, uncertainty=stated)
        pose = make_pose(np.eye(3), np.array([way_m, 0.0, 0.0]))
        samples.append(Sample(way_m, "SERVO", left_m, 0.0, pose, result))
    return simulated_flight(0, np.eye(4), LockstepLog(samples))


def test_the_summary_says_how_many_frames_and_flights_the_distance_s_error_is_of():
    summary = summarise([flight(0.9), flight(1.4)])
    assert summary["distance_from_m"] == 1.0
    assert (summary["distance_frames"], summary["distance_flights"]) == (4, 1)
    assert summary["distance_error_median"] == pytest.approx(0.1)
