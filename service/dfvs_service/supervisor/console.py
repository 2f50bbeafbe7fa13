"""Terminal displays of a flight, and the thread that writes to them."""

import contextlib
import enum
import math
import queue
import sys
import threading
from collections.abc import Callable, Mapping
from pathlib import Path
from typing import Protocol, TextIO

from dfvs_common.progress import StatusLine
from dfvs_service.supervisor.child import new_lines
from dfvs_service.supervisor.heartbeat import Heartbeat

_MOST_LINES = 256
_MOST_STATES = 8
"""So many wait at most before states are left out: the next one is newer."""


class Colour(enum.IntEnum):
    """Colour of a text, as a code of ANSI terminals (SGR)."""

    DIM = 2
    RED = 31
    GREEN = 32
    YELLOW = 33


def painted(text: str, colour: Colour) -> str:
    """Text that a terminal shows in a colour."""
    return f"\x1b[{colour:d}m{text}\x1b[0m"


def shows_colours(stream: TextIO, environment: Mapping[str, str]) -> bool:
    """Whether colours are wanted: a terminal, unless ``NO_COLOR`` or ``TERM=dumb`` is set."""
    is_plain = environment.get("NO_COLOR") or environment.get("TERM") == "dumb"
    return stream.isatty() and not is_plain


class Display(Protocol):
    """Shows how the flight goes."""

    def show(self, heartbeat: Heartbeat) -> None:
        """Take the newest state."""

    def log(self, line: str) -> None:
        """Show a line that must not be lost."""

    def close(self) -> None:
        """Leave the terminal clean."""


def describe(heartbeat: Heartbeat) -> str:
    """One line about a state."""
    error = ""
    if heartbeat.error_m is not None and heartbeat.error_rad is not None:
        error = f"  error {heartbeat.error_m:6.3f} m {math.degrees(heartbeat.error_rad):5.1f}°"
    return f"{heartbeat.state:<9}{error}  {heartbeat.cause}".rstrip()


class LiveLine:
    """One line that is rewritten, for a terminal."""

    def __init__(self, stream: TextIO, width: int) -> None:
        self._stream = stream
        self._width = width
        self._line = StatusLine(stream)

    def show(self, heartbeat: Heartbeat) -> None:
        """Rewrite the line."""
        self._line.show(describe(heartbeat)[: self._width - 1])

    def log(self, line: str) -> None:
        """Print a line above."""
        self._line.clear()
        self._stream.write(f"{line}\n")
        self._stream.flush()

    def close(self) -> None:
        """End the line."""
        self._line.end()


class ChangeLines:
    """One line for every change of state, where there is no terminal."""

    def __init__(self, stream: TextIO) -> None:
        self._stream = stream
        self._last = ""

    def show(self, heartbeat: Heartbeat) -> None:
        """Print a line if the state changed."""
        if heartbeat.state != self._last:
            self._last = heartbeat.state
            self.log(describe(heartbeat))

    def log(self, line: str) -> None:
        """Print a line."""
        self._stream.write(line + "\n")
        self._stream.flush()

    def close(self) -> None:
        """Nothing to clean."""


class JsonLines:
    """The gate's log on standard output as it is written; plain lines go to standard error."""

    def __init__(self, log: Path, stream: TextIO) -> None:
        self._log = log
        self._stream = stream
        self._read = 0

    def show(self, heartbeat: Heartbeat) -> None:
        """Pass on what the gate logged since."""
        del heartbeat
        self._pass_on()

    def _pass_on(self) -> None:
        if not self._log.exists():
            return
        lines = new_lines(self._log, self._read)
        self._read += len(lines)
        self._stream.write(lines.decode(errors="replace"))
        self._stream.flush()

    def log(self, line: str) -> None:
        """Print a line beside the log."""
        print(line, file=sys.stderr)

    def close(self) -> None:
        """Pass on the rest."""
        self._pass_on()


class ConsoleWriter:
    """A display that never blocks, written on a thread of its own.

    A terminal that is stopped (Ctrl-S), or a pipe that nobody reads, blocks whoever writes to it.
    The parent watches over the gate and must not be blocked: lines that find no room are lost.
    """

    def __init__(self, display: Display) -> None:
        self._display = display
        self._todo: queue.Queue[Callable[[], None] | None] = queue.Queue(_MOST_LINES)
        self._thread = threading.Thread(target=self._run, name="console-writer", daemon=True)
        self._thread.start()

    def show(self, heartbeat: Heartbeat) -> None:
        """Show a state, unless others wait already."""
        if self._todo.qsize() < _MOST_STATES:
            self._put(lambda: self._display.show(heartbeat))

    def log(self, line: str) -> None:
        """Show a line."""
        self._put(lambda: self._display.log(line))

    def close(self, timeout_s: float) -> bool:
        """Leave the terminal clean; returns whether all was written in time."""
        self._put(self._display.close)
        self._put(None)
        self._thread.join(timeout_s)
        return not self._thread.is_alive()

    def _put(self, job: Callable[[], None] | None) -> None:
        with contextlib.suppress(queue.Full):
            self._todo.put_nowait(job)

    def _run(self) -> None:
        while (job := self._todo.get()) is not None:
            # A terminal that is gone must not end a flight.
            with contextlib.suppress(OSError, ValueError):
                job()
