"""Pause of a writer whose disk refuses."""

_RETRY_NS = 5_000_000_000
_WELL_NS = 60_000_000_000


class WritePause:
    """Time in which nothing is written, after a refusal; times are monotonic, ns.

    The same refusal is told once, and again after a minute in which nothing was refused.
    """

    def __init__(self) -> None:
        self._until_ns = 0
        self._told = ""

    def holds(self, now_ns: int) -> bool:
        """Whether nothing is to be written yet."""
        return now_ns < self._until_ns

    def begin(self, reason: str, now_ns: int) -> bool:
        """Write nothing for 5 s; returns whether the reason is to be told."""
        is_new = reason != self._told or now_ns > self._until_ns + _WELL_NS
        self._told = reason
        self._until_ns = now_ns + _RETRY_NS
        return is_new

    def end(self, now_ns: int) -> None:
        """Try again at once."""
        self._until_ns = now_ns
