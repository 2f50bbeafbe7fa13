"""Rate limits of periodic actions, and of the published state."""

from __future__ import annotations

from dataclasses import dataclass


@dataclass(slots=True)
class Pace:
    """Lets something happen every so many nanoseconds on average, as soon as it is asked for."""

    period_ns: int
    next_ns: int = 0

    @classmethod
    def of_rate(cls, rate_hz: float) -> Pace:
        """So many times a second; never where that is 0."""
        return cls(round(1e9 / rate_hz) if rate_hz > 0 else 0)

    def due(self, now_ns: int) -> bool:
        """Whether it is time; starts the next period if so."""
        if self.period_ns <= 0 or now_ns < self.next_ns:
            return False
        # What is late does not shift what follows, unless a whole period was missed.
        is_missed = now_ns - self.next_ns >= self.period_ns
        self.next_ns = (now_ns if is_missed else self.next_ns) + self.period_ns
        return True


@dataclass(slots=True)
class StatePace:
    """Lets a gate's status through at a rate, and at once where its state is another one.

    The last state of a service that ends is followed by nothing that would show it.
    """

    pace: Pace
    _state: str = ""

    def due(self, state: str, now_ns: int) -> bool:
        """Whether to publish a status of this state."""
        if not self.pace.due(now_ns) and state == self._state:
            return False
        self._state = state
        return True
