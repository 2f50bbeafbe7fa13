"""Token-bucket rate limit of external input."""

from dataclasses import dataclass

_NS_PER_S = 1_000_000_000


@dataclass(frozen=True, slots=True)
class Rate:
    """So many a second in the long run, and up to ``burst`` at once."""

    per_s: float
    burst: int


class RateLimit:
    """Rate limit of each key; counts what exceeds it.

    Parameters
    ----------
    rate : Rate
        What is let through.
    now_ns : int
        Monotonic time; a later call with an earlier time counts as no time passed.
    """

    def __init__(self, rate: Rate, now_ns: int) -> None:
        self._rate = rate
        self._tokens = float(rate.burst)
        self._filled_ns = now_ns
        self.dropped = 0

    def admits(self, now_ns: int) -> bool:
        """Take one thing that came at ``now_ns``; False if it is one too many."""
        passed_s = max(now_ns - self._filled_ns, 0) / _NS_PER_S
        self._filled_ns = max(self._filled_ns, now_ns)
        self._tokens = min(self._tokens + passed_s * self._rate.per_s, float(self._rate.burst))
        if self._tokens < 1.0:
            self.dropped += 1
            return False
        self._tokens -= 1.0
        return True
