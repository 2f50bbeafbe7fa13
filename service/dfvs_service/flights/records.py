"""Reader of a flight's records, which may end early."""

import json
import os
from collections.abc import Iterator
from dataclasses import dataclass
from datetime import UTC, datetime
from pathlib import Path
from typing import Any, Literal

from dfvs_core.gate.config import S
from dfvs_core.gate.states import GateState
from dfvs_service.flights import layout
from dfvs_service.flights.store import folder_bytes, is_running, parts_of

_TAIL_BYTES = 65536

Status = Literal["running", "ended", "cut off"]


@dataclass(frozen=True, slots=True)
class StateChange:
    """The gate entered ``state``, ``t_s`` after the start of the flight."""

    t_s: float
    state: str
    cause: str
    detail: str

    @property
    def reason(self) -> str:
        """Cause with its detail."""
        return f"{self.cause} ({self.detail})" if self.detail else self.cause


@dataclass(frozen=True, slots=True)
class FlightSummary:
    """What happened in a flight.

    ``duration_s`` is the time from the start to the last record; ``exit_code`` is the service's,
    None where it was not recorded; ``told`` are the errors, warnings and refusing checks
    shown to the user.
    """

    name: str
    folder: str
    vehicle: str
    started: str
    duration_s: float
    status: Status
    exit_code: int | None
    verdict: str
    states: tuple[StateChange, ...]
    told: tuple[str, ...]
    version: str
    size_bytes: int


def read_lines(path: Path) -> Iterator[dict[str, Any]]:
    """JSON objects of a log, up to the first line that is torn or damaged; none without a file."""
    try:
        file = path.open("rb")
    except OSError:
        return
    with file:
        for line in file:
            try:
                record = json.loads(line) if line.endswith(b"\n") else None
            except ValueError:
                return
            if not isinstance(record, dict):
                return
            yield record


def started_ns(folder: Path) -> int | None:
    """Start of the flight of a folder, monotonic ns; None where its header is not there."""
    start_ns = next(read_lines(folder / layout.HEADER), {}).get("started_ns")
    return start_ns if isinstance(start_ns, int) else None


def read_summary(folder: Path) -> FlightSummary:
    """What happened in the flight of a folder, whatever of it is there."""
    header = next(read_lines(folder / layout.HEADER), {})
    gate, service = (list(read_lines(folder / n)) for n in (layout.GATE_LOG, layout.SERVICE_LOG))
    date, vehicle = parts_of(folder.name)
    times = [t for r in (*gate, *service) if isinstance(t := r.get("t_ns"), int)]
    times += [_last_step_ns(folder / layout.GATE_INPUTS)]
    start_ns = started_ns(folder) or min(filter(None, times), default=0)
    states = tuple(_state_change(r, start_ns) for r in gate if r.get("kind") == "transition")
    told = tuple(str(r.get("text", "")) for r in service if r.get("kind") == "told")
    code = next((_code(r) for r in (*service, *gate) if r.get("kind") == "end"), None)
    status: Status = "cut off" if code is None else "ended"
    if is_running(folder):
        status = "running"
    return FlightSummary(
        name=folder.name,
        folder=str(folder),
        vehicle=str(header.get("vehicle", vehicle)),
        started=utc_time(header.get("started_unix_ns")) or date,
        duration_s=max(max(times) - start_ns, 0) / S,
        status=status,
        exit_code=code,
        verdict=_verdict(status, code, states, told),
        states=states,
        told=told,
        version=str(header.get("version", "")),
        size_bytes=folder_bytes(folder),
    )


def _verdict(
    status: Status, code: int | None, states: tuple[StateChange, ...], told: tuple[str, ...]
) -> str:
    """One sentence on how the flight went."""
    state = states[-1].state if states else "IDLE"
    if status == "running":
        return f"running, in {state}"
    if status == "cut off":
        return f"cut off in {state}: the records end before the service did"
    if code == 0:
        return "the goal was reached"
    if errors := [line.removeprefix("error: ") for line in told if line.startswith("error: ")]:
        return errors[-1]
    if not states:
        return f"ended with exit code {code} before the first state"
    last = states[-1]
    verdict = f"ended in {last.state}: {last.reason}"
    waits = [line for line in told if line.startswith("not ready: ")]
    was_ready = any(change.state == GateState.READY for change in states)
    return verdict if was_ready or not waits else f"{verdict}; {waits[-1]}"


def _state_change(record: dict[str, Any], start_ns: int) -> StateChange:
    return StateChange(
        (int(record.get("t_ns", start_ns)) - start_ns) / S,
        str(record.get("target", "")),
        str(record.get("cause", "")),
        str(record.get("detail", "")),
    )


def _code(record: dict[str, Any]) -> int | None:
    code = record.get("code")
    return code if isinstance(code, int) else None


def _last_step_ns(path: Path) -> int:
    """Time of the gate's last recorded step, 0 where there is none."""
    try:
        with path.open("rb") as file:
            file.seek(max(file.seek(0, os.SEEK_END) - _TAIL_BYTES, 0))
            lines = file.read().splitlines(keepends=True)
        whole = (json.loads(line) for line in reversed(lines) if line.endswith(b"\n"))
        return next((int(step["t"]) for step in whole if "t" in step), 0)
    except (OSError, ValueError, KeyError, IndexError, TypeError):
        return 0


def utc_time(t_unix_ns: object) -> str:
    """Time in UTC, ISO 8601; empty where it is not known."""
    if not isinstance(t_unix_ns, int):
        return ""
    return datetime.fromtimestamp(t_unix_ns / S, UTC).isoformat(timespec="seconds")
