"""How often something may happen."""

import itertools

import pytest

from dfvs_service.pace import Pace

MS = 1_000_000


def due(pace, times_ms):
    return [t for t in times_ms if pace.due(t * MS)]


def test_a_rate_is_kept_on_average_though_each_time_is_a_little_late():
    """Asked every 19 ms: 10 a second, where counting from each late one would give 8.8."""
    times = due(Pace.of_rate(10.0), range(1000, 11_000, 19))
    assert len(times) == pytest.approx(100, abs=1)
    assert max(b - a for a, b in itertools.pairwise(times)) < 120


def test_what_was_missed_is_not_made_up_for():
    pace = Pace.of_rate(10.0)
    assert due(pace, [1000, 2000, 2001, 2050, 2099, 2100]) == [1000, 2000, 2100]


def test_a_rate_of_none_is_never():
    assert due(Pace.of_rate(0.0), range(1000)) == []
