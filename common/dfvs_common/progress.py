"""Progress of a command, on standard error."""

import contextlib
import sys
import time
from typing import TextIO


def log(text: str) -> None:
    """Print a line, apart from results; a full disk or a terminal that is gone ends no work."""
    with contextlib.suppress(OSError):
        print(text, file=sys.stderr, flush=True)


def warn(text: str) -> None:
    """Print a line that says what is doubtful."""
    log(f"warning: {text}")


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
        self.is_live = self._stream.isatty()
        self._interval_s = interval_s
        self._next_s = 0.0
        self._is_drawn = False

    def show(self, text: str) -> None:
        """Rewrite the line."""
        if self.is_live and time.monotonic() >= self._next_s:
            self._next_s = time.monotonic() + self._interval_s
            self._write(f"\r\x1b[K{text}", is_drawn=True)

    def clear(self) -> None:
        """Erase the line, if there is one."""
        if self._is_drawn:
            self._write("\r\x1b[K", is_drawn=False)

    def end(self) -> None:
        """Leave the line, if there is one, as it is; what follows is printed below it."""
        if self._is_drawn:
            self._write("\n", is_drawn=False)

    def _write(self, text: str, *, is_drawn: bool) -> None:
        self._is_drawn = is_drawn
        with contextlib.suppress(OSError):
            self._stream.write(text)
            self._stream.flush()
