"""Flights in real time, on machines that may be too busy or too slow for them.

Where frames cannot be compared in time the service refuses to fly, as it should: a flight that
fails there says nothing. No verdict is given on a slow machine; on another one a flight is tried
again, for what may have come in between.
"""

from collections.abc import Callable
from typing import TypeVar

import pytest

from dfvs_sim.demo.pace import match_ms

T = TypeVar("T")

ATTEMPTS = 2


def flown_in_time(fly: Callable[[int], T], has_arrived: Callable[[T], bool], enough_ms: float) -> T:
    """Result of the first flight that arrives, or of the last one; skips on a slow machine.

    ``fly`` takes the number of the attempt; ``enough_ms`` is how long a match may take.
    """
    for attempt in range(ATTEMPTS):
        flight = fly(attempt)
        if has_arrived(flight):
            break
        if (taken_ms := match_ms()) > enough_ms:
            pytest.skip(f"no verdict: {taken_ms:.0f} ms a match, real time needs {enough_ms:g} ms")
    return flight
