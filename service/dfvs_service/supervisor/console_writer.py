"""Console writer on its own thread.

A terminal that is stopped (Ctrl-S), or a pipe that nobody reads, blocks whoever writes to it. The
parent watches over the gate and must not be blocked; so it hands its words on, and those that
find no room are lost.
"""

import contextlib
import queue
import threading
from collections.abc import Callable

from dfvs_service.supervisor.console import Display
from dfvs_service.supervisor.heartbeat import Heartbeat

_MOST_LINES = 256
_MOST_STATES = 8
"""So many wait at most before states are left out: the next one is newer."""


class ConsoleWriter:
    """A display that never blocks."""

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
