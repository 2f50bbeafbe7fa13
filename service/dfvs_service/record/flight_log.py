"""Log lines about state changes of the gate."""

from collections.abc import Iterator
from typing import Literal

from dfvs_core.gate.states import GateState
from dfvs_core.messages.link import GateStatus

Entry = tuple[Literal["INFO", "WARNING", "ERROR"], str]
"""Severity, as Foxglove names its levels, and one line."""


class FlightLog:
    """Logs changes of state with their cause, answers to commands, and each warning once."""

    def __init__(self) -> None:
        self._last: GateStatus | None = None
        self._warned: set[str] = set()

    def entries(self, status: GateStatus) -> Iterator[Entry]:
        """Lines about what changed with this status."""
        last, self._last = self._last, status
        if last is None or (status.state, status.since_ns) != (last.state, last.since_ns):
            text = f"{status.state}: {status.cause}" if status.cause else status.state
            if status.state == GateState.ABORT:
                yield "ERROR", text
            else:
                yield "WARNING" if status.state == GateState.HOLD else "INFO", text
        if last is not None and status.command_count > last.command_count:
            yield "INFO", f"command {status.command_result}"
        for text in status.warnings:
            if text not in self._warned:
                self._warned.add(text)
                yield "WARNING", text
