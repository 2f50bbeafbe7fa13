"""Parent watchdog: a pipe on which the parent shows that it is alive."""

import os

from dfvs_core.gate.config import S
from dfvs_core.gate.events import Stop

SILENCE_NS = 1 * S


class ParentWatchdog:
    """Bytes mean that the parent lives; the pipe's end, or a second without any, that it does not.

    ``descriptor`` is the reading end of the pipe, which is made not to block; ``now_ns`` is the
    monotonic time of the start.
    """

    def __init__(self, descriptor: int, now_ns: int) -> None:
        os.set_blocking(descriptor, False)
        self._descriptor = descriptor
        self._last_received_ns = now_ns
        self.is_cut = False

    def fileno(self) -> int:
        """Descriptor that is readable when there is something to read."""
        return self._descriptor

    def poll(self, now_ns: int) -> Stop | None:
        """Read the signs of life; the command to stop, once, when they are missing."""
        if self.is_cut:
            return None
        try:
            data = os.read(self._descriptor, 4096)
        except BlockingIOError:
            if now_ns - self._last_received_ns <= SILENCE_NS:
                return None
            return self._cut(now_ns, f"for {SILENCE_NS / S:g} s")
        self._last_received_ns = now_ns
        return None if data else self._cut(now_ns, "it has ended")

    def _cut(self, now_ns: int, detail: str) -> Stop:
        self.is_cut = True
        return Stop(now_ns, detail, unsupervised=True)
