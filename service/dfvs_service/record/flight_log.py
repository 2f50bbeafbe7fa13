"""Log lines about state changes of the gate."""

import enum
from collections.abc import Iterator
from dataclasses import dataclass

from dfvs_core.gate.states import GateState
from dfvs_core.messages.link import GateStatus


class Severity(enum.Enum):
    """How much a line matters."""

    INFO = enum.auto()
    WARNING = enum.auto()
    ERROR = enum.auto()


@dataclass(frozen=True, slots=True)
class Entry:
    """One line."""

    severity: Severity
    text: str


_SEVERITY: dict[str, Severity] = {GateState.HOLD: Severity.WARNING, GateState.ABORT: Severity.ERROR}


class FlightLog:
    """Logs changes of state with their cause, answers to commands, and each warning once."""

    def __init__(self) -> None:
        self._last: GateStatus | None = None
        self._warned: set[str] = set()

    def entries(self, status: GateStatus) -> Iterator[Entry]:
        """Lines about what changed with this status."""
        last, self._last = self._last, status
        if last is None or (status.state, status.since_ns) != (last.state, last.since_ns):
            severity = _SEVERITY.get(status.state, Severity.INFO)
            yield Entry(
                severity, f"{status.state}: {status.cause}" if status.cause else status.state
            )
        if last is not None and status.command_count > last.command_count:
            yield Entry(Severity.INFO, f"command {status.command_result}")
        for text in status.warnings:
            if text not in self._warned:
                self._warned.add(text)
                yield Entry(Severity.WARNING, text)
