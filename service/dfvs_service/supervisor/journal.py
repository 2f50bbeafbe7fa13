"""Log of JSON lines, written by a thread."""

import contextlib
import json
import queue
import threading
from collections.abc import Callable
from pathlib import Path
from typing import IO

MAX_WAITING = 2000


class Journal:
    """Appends records to a file; drops them while the disk is slow, and when it is full.

    ``tell`` takes the line that says so, when the journal is closed.
    """

    def __init__(self, path: Path, tell: Callable[[str], None]) -> None:
        self._file: IO[str] = path.open("a", encoding="utf-8")
        self._queue: queue.Queue[str | None] = queue.Queue(MAX_WAITING)
        self._name, self._tell = path.name, tell
        self._dropped = 0
        self._thread = threading.Thread(target=self._write, name="journal", daemon=True)
        self._thread.start()

    def add(self, t_ns: int, kind: str, **values: object) -> None:
        """Write one record, from any thread, without blocking."""
        line = json.dumps({"t_ns": t_ns, "kind": kind, **values}, default=str)
        try:
            self._queue.put_nowait(line)
        except queue.Full:
            self._dropped += 1

    def close(self, timeout_s: float = 0.3) -> None:
        """Write what waits, but do not wait longer than ``timeout_s``."""
        with contextlib.suppress(queue.Full):
            self._queue.put_nowait(None)
        self._thread.join(timeout_s)
        if self._dropped:
            self._tell(f"warning: {self._name} lacks {self._dropped} lines")

    def _write(self) -> None:
        while (line := self._queue.get()) is not None:
            try:
                self._file.write(line + "\n")
                self._file.flush()
            except OSError:
                self._dropped += 1
