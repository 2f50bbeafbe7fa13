"""DONE far from the goal is counted, in simulated flights and in trials of a free camera."""

import math
from dataclasses import replace

import pytest

from dfvs_bench.lockstep.record import SimulatedFlight, summarise
from dfvs_bench.trials.trial import Step, Trial

FLIGHT = SimulatedFlight(
    seed=0,
    end_state="DONE",
    end_cause="",
    start_m=1.0,
    end_s=8.0,
    within_s=6.0,
    moved_m=1.0,
    hold_rms_m=0.01,
    hold_heading_rms_deg=0.2,
    farthest_m=1.0,
    distance_error=(),
    distance_spread=(),
)


@pytest.mark.parametrize(
    ("changes", "count"),
    [
        ({}, 0),
        ({"hold_rms_m": 0.149}, 0),
        ({"hold_rms_m": 0.151}, 1),
        ({"hold_heading_rms_deg": 3.1}, 1),
        ({"hold_rms_m": None, "hold_heading_rms_deg": None, "end_state": "ABORT"}, 0),
    ],
)
def test_flights_that_rest_elsewhere_are_counted(changes, count):
    assert summarise([FLIGHT, replace(FLIGHT, **changes)])["false_done"] == count


@pytest.mark.parametrize(
    ("end", "distance_m", "angle_deg", "is_false"),
    [
        ("done", 0.01, 0.1, False),
        ("done", 0.119, 2.9, False),
        ("done", 0.121, 0.1, True),
        ("done", 0.01, 3.1, True),
        ("iterations", 0.5, 10.0, False),
    ],
)
def test_a_trial_is_falsely_done_by_its_own_rule_alone(end, distance_m, angle_deg, is_false):
    last = Step((0.0, 0.0, 0.0), distance_m, math.radians(angle_deg), None, (0.0,) * 6)
    assert Trial((last,), end, (0.0,) * 16).is_false_done is is_false
