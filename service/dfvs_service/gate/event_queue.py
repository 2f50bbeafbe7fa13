"""Event queue from other threads to the gate's loop."""

import contextlib
import os
from collections import deque

from dfvs_core.gate.events import Event

MAX_WAITING = 4096


class EventQueue:
    """Queue that wakes a ``select``; the oldest event is dropped when it is full.

    ``put`` never blocks and may be called from any thread and from a signal handler.
    """

    def __init__(self) -> None:
        self._waiting: deque[Event] = deque(maxlen=MAX_WAITING)
        self._reader, self._writer = os.pipe()
        os.set_blocking(self._reader, False)
        os.set_blocking(self._writer, False)

    def fileno(self) -> int:
        """Descriptor that is readable while events wait."""
        return self._reader

    def put(self, event: Event) -> None:
        """Add an event and wake the loop."""
        self._waiting.append(event)
        with contextlib.suppress(BlockingIOError):
            os.write(self._writer, b"!")

    def drain(self) -> list[Event]:
        """All events that wait, oldest first."""
        with contextlib.suppress(BlockingIOError):
            while os.read(self._reader, 4096):
                pass
        events: list[Event] = []
        while self._waiting:
            events.append(self._waiting.popleft())
        return events
