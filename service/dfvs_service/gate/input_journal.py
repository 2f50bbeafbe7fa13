"""Journal of the gate's inputs, written by a thread."""

import contextlib
import queue
import threading
from collections.abc import Sequence
from pathlib import Path
from typing import IO

from dfvs_core.gate.config import GateConfig
from dfvs_core.gate.events import Event, GateOutput
from dfvs_core.gate.replay import encode_gap, encode_start, encode_step

MAX_WAITING = 2000
MAX_BYTES = 128 * 1024 * 1024
"""Over an hour: some 30 kB a second."""

_Step = tuple[int, Sequence[Event], GateOutput]


class InputJournal:
    """Journal of one run of the gate; see ``dfvs_core.gate.replay``.

    What no replay could use is not written: the journal ends at the first step that a slow disk
    leaves no room for, when the disk is full, and at its greatest size. The gate goes on.
    """

    def __init__(
        self, path: Path, config: GateConfig, t_ns: int, max_bytes: int = MAX_BYTES
    ) -> None:
        self._file: IO[str] = path.open("w", encoding="utf-8")
        self._queue: queue.Queue[_Step | None] = queue.Queue(MAX_WAITING)
        self._left = max_bytes
        self._lost = 0
        self.has_ended = False
        """Nothing more is written."""
        self._write(encode_start(config, t_ns))
        self._thread = threading.Thread(target=self._run, name="input-journal", daemon=True)
        self._thread.start()

    def add(self, t_ns: int, events: Sequence[Event], output: GateOutput) -> None:
        """Record one step, without blocking."""
        if self.has_ended or self._lost:
            self._lost += 1
            return
        try:
            self._queue.put_nowait((t_ns, events, output))
        except queue.Full:
            self._lost += 1

    def close(self, timeout_s: float = 0.3) -> None:
        """Write what waits, but do not wait longer than ``timeout_s``."""
        with contextlib.suppress(queue.Full):
            self._queue.put_nowait(None)
        self._thread.join(timeout_s)

    def _run(self) -> None:
        while (step := self._queue.get()) is not None:
            self._write(encode_step(*step))
            if self._lost and self._queue.empty():
                self._write(encode_gap(self._lost))
                self.has_ended = True

    def _write(self, line: str) -> None:
        self._left -= len(line) + 1
        if self._left < 0:
            self.has_ended = True
        if self.has_ended:
            return
        try:
            self._file.write(line + "\n")
            self._file.flush()
        except OSError:
            self.has_ended = True
