"""Progress of a command, on standard error."""

import sys
import time
from typing import TextIO


def log(text: str) -> None:
    """Print a line, apart from results."""
    print(text, file=sys.stderr, flush=True)


class StatusLine:
    """One line that is rewritten in a terminal; nothing where the stream is none.

    Parameters
    ----------
    stream : TextIO, optional
        Standard error by default.
    interval_s : float
        Texts that follow each other sooner are left out.
    """

    def __init__(self, stream: TextIO | None = None, interval_s: float = 0.0) -> None:
        self._stream = stream or sys.stderr
        self._is_shown = self._stream.isatty()
        self._interval_s = interval_s
        self._next_s = 0.0

    def show(self, text: str) -> None:
        """Rewrite the line."""
        if self._is_shown and time.monotonic() >= self._next_s:
            self._next_s = time.monotonic() + self._interval_s
            self._write(f"\r\x1b[K{text}")

    def clear(self) -> None:
        """Erase the line."""
        if self._is_shown:
            self._write("\r\x1b[K")

    def end(self) -> None:
        """Leave the line as it is; what follows is printed below it."""
        if self._is_shown:
            self._write("\n")

    def _write(self, text: str) -> None:
        self._stream.write(text)
        self._stream.flush()
