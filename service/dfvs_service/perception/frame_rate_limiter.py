"""Rate limiter of invalid frames, on Zenoh's thread."""

from dfvs_core.errors import WireError
from dfvs_core.messages.frame import decode_header
from dfvs_core.messages.rate_limit import Rate, RateLimit

_BURST = 10


class FrameRateLimiter:
    """Judges frames by their header alone; called from one thread.

    Some invalid ones pass all the same, so often that perception reports what is wrong with them
    and never that none came.

    ``size`` (width, height) px is that of every frame. After ``silence_s`` without one perception
    reports that; two invalid ones pass in this time.
    """

    def __init__(self, size: tuple[int, int], silence_s: float, now_ns: int) -> None:
        self._size = size
        self._bad = RateLimit(Rate(2.0 / silence_s, _BURST), now_ns)

    @property
    def turned_away(self) -> int:
        """How many frames nobody looked at."""
        return self._bad.dropped

    def admits(self, attachment: bytes, now_ns: int) -> bool:
        """Whether perception shall process a frame with this attachment."""
        try:
            header = decode_header(attachment)
        except WireError:
            return self._bad.admits(now_ns)
        return (header.width, header.height) == self._size or self._bad.admits(now_ns)
