"""Which of the gate's states are published."""

import pytest

from dfvs_service.operator_link.state_pace import StatePace
from dfvs_service.pace import Pace

MS = 1_000_000
TICK_NS = 20 * MS


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
