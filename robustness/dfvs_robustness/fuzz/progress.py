"""A line on stderr every few seconds, while a run goes on."""

import time

from dfvs_common.progress import log

_PERIOD_S = 5.0


class ProgressLine:
    """Prints at most one line every few seconds."""

    def __init__(self) -> None:
        self._next_s = 0.0

    def show(self, text: str) -> None:
        """Print the text if it is time to."""
        now_s = time.monotonic()
        if now_s >= self._next_s:
            self._next_s = now_s + _PERIOD_S
            log(f"  {text}")
