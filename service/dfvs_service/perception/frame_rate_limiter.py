"""Rate limiter of invalid frames, on Zenoh's thread."""

from dfvs_core.errors import WireError
from dfvs_core.messages.frame import decode_header
from dfvs_core.messages.rate_limit import Rate, RateLimit

BAD_FRAME_RATE = Rate(per_s=5.0, burst=5)
"""So many are let in all the same, so that perception reports what is wrong with them."""


class FrameRateLimiter:
    """Judges frames by their header alone; called from one thread.

    Parameters
    ----------
    size : (int, int)
        Width and height that every frame must have, px.
    now_ns : int
        Monotonic time.
    """

    def __init__(self, size: tuple[int, int], now_ns: int) -> None:
        self._size = size
        self._bad = RateLimit(BAD_FRAME_RATE, now_ns)

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
