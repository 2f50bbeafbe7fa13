"""How often something may happen, and which of the gate's states are published."""

import itertools

import pytest

from dfvs_service.pace import Pace, StatePace

MS = 1_000_000
TICK_NS = 20 * MS


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


def published(states):
    """Those of these states, one every 20 ms, that are let through."""
    pace = StatePace(Pace.of_rate(10.0))
    return [s for k, s in enumerate(states) if pace.due(s, 10**12 + k * TICK_NS)]


def test_a_state_that_stays_is_published_at_the_rate():
    assert published(["SERVO"] * 50) == ["SERVO"] * 10


@pytest.mark.parametrize("before", range(20, 40))
def test_the_last_state_is_published_whenever_it_comes(before):
    assert published(["SERVO"] * before + ["RELEASED"])[-1] == "RELEASED"


def test_every_state_is_published_however_short_it_is():
    states = ["SERVO", "HOLD", "SERVO", "ABORT", "PREFLIGHT"]
    assert published(states) == states
