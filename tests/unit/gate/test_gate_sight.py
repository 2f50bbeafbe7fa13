"""What the gate remembers of reports, by itself."""

import pytest

from dfvs_core.gate.config import MS, GateTiming
from dfvs_core.gate.sight import Sight
from dfvs_core.gate.states import Cause
from dfvs_core.wire.link import PerceptionReport

NOW = 10_000 * MS


def report(age_ms=40, **changes):
    values = {
        "seq": 1,
        "t_capture_ns": NOW - age_ms * MS,
        "velocity": (0.1, 0.0, 0.0, 0.0),
        "healthy": True,
        "reached": False,
        "lost": False,
        "reason": "",
        "error_m": 1.0,
        "error_rad": 0.1,
        "overlap": 0.8,
    }
    return PerceptionReport(**{**values, **changes})


@pytest.fixture
def sight():
    return Sight(GateTiming())


def test_another_goal_is_neither_seen_nor_lost_yet(sight):
    sight.take(report(lost=True), NOW)
    sight.look_for("ab", (Cause.OPERATOR_GOAL, "ab"))
    assert (sight.overlap, sight.lost, sight.goal) == (0.0, False, "ab")
    assert sight.fault == (Cause.OPERATOR_GOAL, "ab")


def test_time_of_good_data_is_counted_from_the_first_good_report(sight):
    assert sight.good_for_ns(NOW) == -1
    sight.take(report(), NOW)
    assert sight.good_for_ns(NOW + 5) == 5
    sight.take(report(age_ms=20), NOW + 10 * MS)
    assert sight.good_for_ns(NOW + 20 * MS) == 20 * MS
    sight.take(report(age_ms=10, healthy=False), NOW + 30 * MS)
    assert sight.good_for_ns(NOW + 40 * MS) == -1
