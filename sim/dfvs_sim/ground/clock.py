"""The vehicle's clock on this machine's: offset and rate from the messages that came soonest.

A message can only arrive later than it was made. Arrival minus stamp is therefore the difference
of the clocks plus a delay. Its lower envelope over some seconds is a line. The slope is the
difference of the rates, which a simulation that is slower than real time has.
"""

from collections import deque
from typing import NamedTuple

_INTERVAL_NS = 250_000_000
_INTERVALS = 16
"""The line is fitted to the soonest message of each of so many intervals: 4 s."""
_FEWEST = 8
"""Intervals below which the clocks are taken to run alike."""
_RATE_LIMIT = 0.2
"""Largest difference of the rates that is followed."""
_RESTART_NS = 1_000_000_000


class _Pair(NamedTuple):
    stamp_ns: int
    offset_ns: int


class ClockMap:
    """Vehicle time to this machine's monotonic time, as of the newest message."""

    def __init__(self) -> None:
        self._soonest: deque[_Pair] = deque(maxlen=_INTERVALS)
        self._interval_ns = 0
        self._rate = 0.0
        self.offset_ns = 0
        """What to add to a vehicle time."""

    def update(self, stamp_ns: int, arrival_ns: int) -> bool:
        """Take one pair of times; True where the vehicle's clock has started anew."""
        pair = _Pair(stamp_ns, arrival_ns - stamp_ns)
        restarted = bool(self._soonest) and abs(pair.offset_ns - self.offset_ns) > _RESTART_NS
        if restarted:
            self._soonest.clear()
            self._rate = 0.0
        if not self._soonest or arrival_ns - self._interval_ns >= _INTERVAL_NS:
            self._rate = _rate(list(self._soonest), self._rate)
            self._interval_ns = arrival_ns
            self._soonest.append(pair)
        elif pair.offset_ns < self._soonest[-1].offset_ns:
            self._soonest[-1] = pair
        self.offset_ns = min(_carried(p, stamp_ns, self._rate) for p in self._soonest)
        return restarted


def _carried(pair: _Pair, stamp_ns: int, rate: float) -> int:
    """Offset of the pair, carried on to a stamp."""
    return pair.offset_ns + round(rate * (stamp_ns - pair.stamp_ns))


def _rate(pairs: list[_Pair], rate: float) -> float:
    """Slope of the lower envelope: between the soonest of the older and of the newer half.

    Soonest is meant after the slope is taken off, hence the rate so far and the repetition.
    """
    if len(pairs) < _FEWEST:
        return rate
    end_ns = pairs[-1].stamp_ns
    for _ in range(2):
        older, newer = (
            min(half, key=lambda p: _carried(p, end_ns, rate))
            for half in (pairs[: len(pairs) // 2], pairs[len(pairs) // 2 :])
        )
        if newer.stamp_ns > older.stamp_ns:
            rate = (newer.offset_ns - older.offset_ns) / (newer.stamp_ns - older.stamp_ns)
    return min(_RATE_LIMIT, max(-_RATE_LIMIT, rate))
