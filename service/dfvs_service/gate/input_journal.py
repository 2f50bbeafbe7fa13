"""Journal of the gate's inputs, written by a thread."""

import contextlib
import queue
import threading
from collections import deque
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import IO

from dfvs_core.gate.config import GateConfig, S
from dfvs_core.gate.events import Event, GateOutput
from dfvs_core.gate.replay import encode_gap, encode_start, encode_step

MAX_WAITING = 2000
MAX_BYTES = 128 * 1024 * 1024
"""Over an hour: some 30 kB a second."""
MARGIN_NS = 5 * S
"""Time before and after an engagement that is written with it."""
_GAP_BYTES = 64
"""Room of a gap line."""


@dataclass(frozen=True, slots=True)
class _Step:
    t_ns: int
    events: Sequence[Event]
    output: GateOutput
    is_flight: bool


class InputJournal:
    """Journal of one run of the gate; see ``dfvs_core.gate.replay``.

    Half of its size is kept for flights: once the other half is used up, steps outside of
    engagements are left out, and a gap line says so. The journal ends with a gap line at its
    greatest size and at the first step that a slow disk leaves no room for, and when the disk is
    full. The gate goes on.

    ``path`` is written anew, up to ``max_bytes``; ``t_ns`` is the monotonic time of the gate's
    start. ``report`` takes the line that says why the journal has ended; called on any thread, it
    must not block.
    """

    def __init__(
        self,
        path: Path,
        config: GateConfig,
        t_ns: int,
        report: Callable[[str], None],
        max_bytes: int = MAX_BYTES,
    ) -> None:
        self._file: IO[str] = path.open("w", encoding="utf-8")
        self._name = path.name
        self._report = report
        self._queue: queue.Queue[_Step | None] = queue.Queue(MAX_WAITING)
        self._left = max_bytes
        self._kept_for_flights = max_bytes // 2
        self._lost = 0
        self._recent: deque[_Step] = deque()
        """Last steps before an engagement, where the others are left out."""
        self._left_out = 0
        self._flight_until_ns = t_ns
        self.has_ended = False
        """Nothing more is written."""
        self._write(encode_start(config, t_ns))
        self._thread = threading.Thread(target=self._run, name="input-journal", daemon=True)
        self._thread.start()

    def add(
        self, t_ns: int, events: Sequence[Event], output: GateOutput, *, is_flight: bool
    ) -> None:
        """Record one step, without blocking; ``is_flight`` where the gate is engaged."""
        if self.has_ended or self._lost:
            self._lost += 1
            return
        try:
            self._queue.put_nowait(_Step(t_ns, events, output, is_flight))
        except queue.Full:
            self._lost += 1
            self._tell_end("the disk is too slow")

    def close(self, timeout_s: float = 0.3) -> None:
        """Write what waits, but do not wait longer than ``timeout_s``."""
        with contextlib.suppress(queue.Full):
            self._queue.put_nowait(None)
        self._thread.join(timeout_s)

    def _run(self) -> None:
        while (step := self._queue.get()) is not None:
            self._take(step)
            if self._lost and self._queue.empty():
                self._append(encode_gap(self._lost))
                self.has_ended = True
        if self._left_out + len(self._recent):
            self._append(encode_gap(self._left_out + len(self._recent)))

    def _take(self, step: _Step) -> None:
        """Write a step, or keep it for the case that an engagement follows."""
        if step.is_flight:
            self._flight_until_ns = step.t_ns + MARGIN_NS
        if step.t_ns > self._flight_until_ns and self._left < self._kept_for_flights:
            self._recent.append(step)
            while self._recent[0].t_ns < step.t_ns - MARGIN_NS:
                self._recent.popleft()
                self._left_out += 1
            return
        if self._left_out:
            self._write(encode_gap(self._left_out))
            self._left_out = 0
        while self._recent:
            self._write_step(self._recent.popleft())
        self._write_step(step)

    def _write_step(self, step: _Step) -> None:
        self._write(encode_step(step.t_ns, step.events, step.output))

    def _write(self, line: str) -> None:
        """Write a line where it leaves room for a gap line; else end."""
        if self.has_ended:
            return
        if len(line) + 1 > self._left - _GAP_BYTES:
            self._append(encode_gap(1))
            self.has_ended = True
            self._tell_end("it is as large as it may be")
        else:
            self._append(line)

    def _append(self, line: str) -> None:
        if self.has_ended:
            return
        self._left -= len(line) + 1
        try:
            self._file.write(line + "\n")
            self._file.flush()
        except OSError as error:
            self.has_ended = True
            self._tell_end(error.strerror or str(error))

    def _tell_end(self, reason: str) -> None:
        self._report(f"the gate keeps no more of {self._name}: {reason}")
