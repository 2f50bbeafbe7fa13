"""Ages of vehicles' monotonic stamps by this machine's wall clock."""

from dataclasses import dataclass

_SAME_CLOCK_NS = 10_000_000_000


@dataclass(frozen=True, slots=True)
class Moment:
    """One instant on this machine: monotonic ns, and the wall clock in ms since 1970."""

    t_ns: int
    wall_ms: float


class SenderClock:
    """Ages of one sender's stamps.

    A sender on this machine stamps with our own monotonic clock, and ages are exact. A sender
    elsewhere counts from its own boot: then the quickest message so far counts as undelayed, and
    ages are what later ones took longer than that.
    """

    def __init__(self) -> None:
        self.is_foreign = False
        self._least_lag_ns: int | None = None

    def age_ns(self, t_ns: int, now_ns: int) -> int:
        """Age in ns of something stamped ``t_ns`` that is here at ``now_ns``; never negative."""
        lag = now_ns - t_ns
        if not self.is_foreign and 0 <= lag < _SAME_CLOCK_NS:
            return lag
        self.is_foreign = True
        least = self._least_lag_ns
        # Much later than ever before: the sender has booted, and counts from zero again.
        if least is None or lag < least or lag - least > _SAME_CLOCK_NS:
            self._least_lag_ns = least = lag
        return lag - least

    def wall_ms(self, t_ns: int, now: Moment) -> float:
        """Wall-clock time in ms of a stamp, by this machine's clock."""
        return now.wall_ms - self.age_ns(t_ns, now.t_ns) * 1e-6
