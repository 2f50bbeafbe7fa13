"""Ages of vehicles' monotonic stamps by this machine's wall clock."""

from dataclasses import dataclass

from dfvs_core.messages.frame import NO_CLOCK

_SAME_CLOCK_NS = 10_000_000_000
"""Delay of the quickest message below which a sender without an identity has our clock."""
_RATE_DIFFERENCE = 500e-6
"""Largest relative difference between the rates of two monotonic clocks, one of them slewed."""
_BOOT_NS = 1_000_000_000
"""Step back of a state's stamp that no link explains."""


@dataclass(frozen=True, slots=True)
class Moment:
    """One instant on this machine: monotonic ns, and the wall clock in ms since 1970."""

    t_ns: int
    wall_ms: float

    @property
    def offset_ms(self) -> float:
        """Wall clock less monotonic clock, ms: another one once the wall clock was set."""
        return self.wall_ms - self.t_ns * 1e-6


class SenderClock:
    """Ages of one sender's stamps.

    A sender on this machine stamps with our own monotonic clock, and ages are exact. A sender
    elsewhere counts from its own boot: then the quickest message so far counts as undelayed, and
    ages are what later ones took longer than that. A later one replaces it where the difference is
    no more than the clocks may have drifted apart. Which of both senders it is follows from the
    identity of the sender's clock, and without one from the delay of the quickest message.

    ``local_clock`` is the identity of this machine's clock; ``NO_CLOCK`` where it is not known.
    """

    def __init__(self, local_clock: bytes = NO_CLOCK) -> None:
        self._local_clock = local_clock
        self._clock = NO_CLOCK
        self._least_lag_ns: int | None = None
        self._least_at_ns = 0
        self._newest_state_ns: int | None = None

    @property
    def is_identified(self) -> bool:
        """Whether the identity of the sender's clock is known."""
        return self._clock != NO_CLOCK

    @property
    def is_foreign(self) -> bool:
        """Whether the sender stamps with another machine's clock."""
        if self.is_identified:
            return self._clock != self._local_clock
        least = self._least_lag_ns
        return least is not None and not 0 <= least < _SAME_CLOCK_NS

    def identify(self, clock: bytes) -> None:
        """Take the identity of the sender's clock from a frame; ``NO_CLOCK`` tells nothing."""
        if NO_CLOCK in (clock, self._local_clock) or clock == self._clock:
            return
        self._clock = clock
        self._least_lag_ns = self._newest_state_ns = None

    def on_state(self, t_ns: int, now_ns: int) -> None:
        """Take the stamp of a state: where a foreign one jumps back, the sender has booted."""
        newest = self._newest_state_ns
        if self.is_foreign and newest is not None and t_ns < newest - _BOOT_NS:
            self._least_lag_ns = None
        self._newest_state_ns = t_ns
        self.on_message(t_ns, now_ns)

    def on_message(self, t_ns: int, now_ns: int) -> None:
        """Take the stamp of a message that was sent when it was stamped, or soon after."""
        lag, least = now_ns - t_ns, self._least_lag_ns
        drift_ns = (now_ns - self._least_at_ns) * _RATE_DIFFERENCE if self.is_foreign else 0
        if least is None or lag <= least + drift_ns:
            self._least_lag_ns, self._least_at_ns = lag, now_ns

    def age_ns(self, t_ns: int, now_ns: int) -> int:
        """Age in ns of something stamped ``t_ns`` that is here at ``now_ns``; never negative."""
        lag, least = now_ns - t_ns, self._least_lag_ns
        if self.is_foreign:
            lag = 0 if least is None else lag - least
        return max(lag, 0)

    def wall_ms(self, t_ns: int, now: Moment) -> float:
        """Wall-clock time in ms of a stamp, by this machine's clock."""
        return now.wall_ms - self.age_ns(t_ns, now.t_ns) * 1e-6
