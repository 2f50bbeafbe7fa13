"""Rate, bandwidth and losses of a stream."""

from collections import deque
from typing import Any

_WINDOW_NS = 2_000_000_000
_PAUSE_NS = 1_000_000_000
_MOST_SKIPPED = 1000


class StreamRate:
    """Rate over the last two seconds, age of the newest message, and gaps in the numbering."""

    def __init__(self) -> None:
        self._seen: deque[tuple[int, int]] = deque(maxlen=1024)
        self._last_seq: int | None = None
        self.count = 0
        self.missing = 0

    def note(self, t_ns: int, size: int = 0, seq: int | None = None, replaced: int = 0) -> None:
        """Note a message of so many bytes that came at ``t_ns``, with its number if it has one.

        What the numbering skips counts as missing, except after a pause (nobody watched) and
        where it jumps back or far ahead (a new sender). ``replaced`` messages directly before it
        came too, and were not noted: they are not missing.
        """
        is_steady = bool(self._seen) and t_ns - self._seen[-1][0] < _PAUSE_NS
        if is_steady and seq is not None and self._last_seq is not None:
            skipped = seq - self._last_seq - 1
            self.missing += max(skipped - replaced, 0) if skipped < _MOST_SKIPPED else 0
        self.count += 1
        self._last_seq = seq
        self._seen.append((t_ns, size))

    def summary(self, now_ns: int) -> dict[str, Any]:
        """Rate in Hz, bytes a second, age in s (None before the first one), counts."""
        while self._seen and now_ns - self._seen[0][0] > _WINDOW_NS and len(self._seen) > 1:
            self._seen.popleft()
        recent = [size for t_ns, size in self._seen if now_ns - t_ns <= _WINDOW_NS]
        newest = self._seen[-1][0] if self._seen else None
        return {
            "hz": len(recent) / (_WINDOW_NS * 1e-9),
            "bytes_s": sum(recent) / (_WINDOW_NS * 1e-9),
            "age_s": None if newest is None else (now_ns - newest) * 1e-9,
            "count": self.count,
            "missing": self.missing,
        }
