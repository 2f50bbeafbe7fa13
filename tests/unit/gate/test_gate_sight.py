"""What the gate remembers of reports, by itself."""

import pytest
from gate_rehearsal import Rehearsal

from dfvs_core.gate.checks.perception_monitor import PerceptionMonitor, is_late
from dfvs_core.gate.config import MS, GateTiming
from dfvs_core.gate.states import Cause

NOW = 10_000 * MS
TIMING = GateTiming()


def report(age_ms=40, **changes):
    return Rehearsal().report(**{"t_capture_ns": NOW - age_ms * MS} | changes).report


@pytest.fixture
def sight():
    return PerceptionMonitor(TIMING)


def test_another_goal_is_neither_seen_nor_lost_yet(sight):
    sight.update(report(lost=True), NOW)
    sight.set_goal("ab", (Cause.OPERATOR_GOAL, "ab"))
    assert (sight.overlap, sight.lost, sight.goal) == (0.0, False, "ab")
    assert sight.fault == (Cause.OPERATOR_GOAL, "ab")


def test_time_of_good_data_is_counted_from_the_first_good_report(sight):
    assert sight.good_for_ns(NOW) == -1
    sight.update(report(), NOW)
    assert sight.good_for_ns(NOW + 5) == 5
    sight.update(report(age_ms=20), NOW + 10 * MS)
    assert sight.good_for_ns(NOW + 20 * MS) == 20 * MS
    sight.update(report(age_ms=10, healthy=False), NOW + 30 * MS)
    assert sight.good_for_ns(NOW + 40 * MS) == -1


# --- late results ---------------------------------------------------------------------------


@pytest.mark.parametrize(("age_ns", "late"), [(200 * MS, False), (200 * MS + 1, True)])
def test_a_result_is_late_beyond_its_limit_and_not_at_it(age_ns, late):
    assert is_late(report(t_capture_ns=NOW - age_ns), NOW, TIMING) is late


def test_a_late_result_leaves_the_last_good_frame_as_it_is(sight):
    first = report()
    sight.update(first, NOW)
    later = NOW + 201 * MS
    assert sight.update(report(t_capture_ns=NOW, velocity=(0.1, 0.0, 0.0, 0.0)), later) is None
    assert sight.good is first
    assert sight.last_capture_ns == first.t_capture_ns
    assert sight.good_for_ns(later) == 201 * MS
    assert sight.pace(later)[0] == 1.0
    assert sight.stale(later) is None


def test_late_results_alone_do_not_keep_the_last_good_frame_fresh(sight):
    sight.update(report(age_ms=0), NOW)
    for age_ms in (220, 240, 250):
        sight.update(report(t_capture_ns=NOW + (age_ms - 201) * MS), NOW + age_ms * MS)
        assert sight.stale(NOW + age_ms * MS) is None
    assert sight.stale(NOW + 251 * MS) == (Cause.FRAME_OLD, "251 ms")
    assert sight.good is None


def test_a_late_result_says_so_where_no_good_frame_is_left(sight):
    assert sight.update(report(age_ms=201), NOW) is None
    assert sight.stale(NOW) == (Cause.RESULT_LATE, "201 ms after capture")
    assert (sight.good_for_ns(NOW), sight.pace(NOW)) == (-1, (0.0, 0))
    assert sight.update(report(age_ms=200), NOW) is None
    assert sight.stale(NOW) is None


def test_a_late_result_that_is_unhealthy_spoils_as_any_other(sight):
    sight.update(report(), NOW)
    late = report(t_capture_ns=NOW, healthy=False, reason="black")
    assert sight.update(late, NOW + 220 * MS) == (Cause.REPORT_UNHEALTHY, "black")
    assert sight.good is None
