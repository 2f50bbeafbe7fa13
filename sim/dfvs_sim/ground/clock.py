"""The vehicle's clock on this machine's: offset and rate from the messages that came soonest.

A message can only arrive later than it was made. Arrival minus stamp is therefore the difference
of the clocks plus a delay. Its lower envelope over some seconds is a line. The slope is the
difference of the rates, which a simulation that is slower than real time has.
"""

from collections import deque
from collections.abc import Callable
from typing import NamedTuple

_INTERVAL_NS = 250_000_000
_INTERVALS = 16
"""The line is fitted to the soonest message of each of so many intervals: 4 s."""
_FEWEST = 8
"""Intervals below which the clocks are taken to run alike."""
_FASTEST, _SLOWEST = 1.25, 0.45
"""Rates of the vehicle's clock, in shares of real time, that are followed."""
_RESTART_NS = 1_000_000_000
"""Step of the offset from one message to the next that only another start explains."""
_SLOW = 0.9
_SLOW_NS = 5_000_000_000
"""How long the rate has to be below ``_SLOW`` to be told: one stop of the vehicle's clock stays
in the line for 4 s."""


class _Pair(NamedTuple):
    stamp_ns: int
    offset_ns: int


class ClockMap:
    """Vehicle time to this machine's monotonic time, as of the newest message."""

    def __init__(self) -> None:
        self._soonest: deque[_Pair] = deque(maxlen=_INTERVALS)
        self._newest: _Pair | None = None
        self._interval_ns = 0
        self._rate = 0.0
        self.offset_ns = 0
        """What to add to the vehicle time of the newest message."""

    def update(self, stamp_ns: int, arrival_ns: int) -> bool:
        """Take one pair of times; True where the vehicle's clock has started anew."""
        pair = _Pair(stamp_ns, arrival_ns - stamp_ns)
        newest, self._newest = self._newest, pair
        restarted = newest is not None and abs(pair.offset_ns - newest.offset_ns) > _RESTART_NS
        if restarted:
            self._soonest.clear()
            self._rate = 0.0
        if not self._soonest or arrival_ns - self._interval_ns >= _INTERVAL_NS:
            self._rate = _rate(list(self._soonest), self._rate)
            self._interval_ns = arrival_ns
            self._soonest.append(pair)
        elif pair.offset_ns < _carried(self._soonest[-1], stamp_ns, self._rate):
            self._soonest[-1] = pair
        self.offset_ns = min(_carried(p, stamp_ns, self._rate) for p in self._soonest)
        return restarted

    def vehicle_ns(self, local_ns: int) -> int:
        """Vehicle time at a monotonic time of this machine."""
        if self._newest is None:
            return local_ns
        newest_ns = self._newest.stamp_ns
        return newest_ns + round((local_ns - newest_ns - self.offset_ns) / (1.0 + self._rate))

    def local_ns(self, stamp_ns: int) -> int:
        """Monotonic time of this machine at a vehicle time."""
        if self._newest is None:
            return stamp_ns
        newest = _Pair(self._newest.stamp_ns, self.offset_ns)
        return stamp_ns + _carried(newest, stamp_ns, self._rate)

    @property
    def simulation_rate(self) -> float | None:
        """Vehicle time that passes in a second of real time; None until it is measured."""
        return 1.0 / (1.0 + self._rate) if len(self._soonest) == _INTERVALS else None


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
    return min(1.0 / _SLOWEST - 1.0, max(1.0 / _FASTEST - 1.0, rate))


class SlowClockNotice:
    """Tells once, in one line, that the vehicle's clock is slower than real time."""

    def __init__(self, log: Callable[[str], None]) -> None:
        self._log = log
        self._since_ns: int | None = None
        self._is_told = False

    def update(self, rate: float | None, now_ns: int) -> None:
        """Take the present rate of the vehicle's clock, None where it is not known."""
        if self._is_told or rate is None or rate >= _SLOW:
            self._since_ns = None
            return
        if self._since_ns is None:
            self._since_ns = now_ns
        elif now_ns - self._since_ns >= _SLOW_NS:
            self._is_told = True
            self._log(
                f"the simulation runs at {rate:.2f} of real time: this machine is too slow or busy "
                "for it"
            )
