"""Journal of the gate: encoding, reading and replay of the state machine's inputs and outputs.

One JSON document a line: first the settings and the time of the start, then every step with its
time, its events in the order of arrival, and what came out. The machine is deterministic, so the
same inputs must give the very same commands; ``replay`` shows that they do, or where they do not.
"""

import dataclasses
import json
import typing
from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass
from typing import Any

from dfvs_core.errors import ConfigError, WireError
from dfvs_core.gate.config import GateConfig
from dfvs_core.gate.events import Event, GateOutput, MonitorFailed, OperatorCommand
from dfvs_core.gate.machine import GateMachine
from dfvs_core.gate.states import Transition
from dfvs_core.messages.schema import dump, parse, rebuild, with_present_names

JOURNAL_FORMAT = "dfvs-gate-journal/1"

EVENT_KINDS: dict[str, type[Any]] = {cls.__name__: cls for cls in typing.get_args(Event)}
EVENT_KINDS |= {"Order": OperatorCommand, "WatchEnded": MonitorFailed}
"""Kinds of events by name, those of older journals among them."""


def encode_start(config: GateConfig, t_ns: int) -> str:
    """First line of a journal."""
    return json.dumps({"format": JOURNAL_FORMAT, "t_ns": t_ns, "config": dump(config)})


def encode_step(t_ns: int, events: Sequence[Event], output: GateOutput) -> str:
    """Line of one step."""
    inputs = [[type(event).__name__, *_values(event)] for event in events]
    return json.dumps(
        {"t": t_ns, "in": inputs, "out": _encode_output(output)}, separators=(",", ":")
    )


def encode_gap(steps: int) -> str:
    """Line in place of steps that were not written: how many, or how many when it was noticed."""
    return json.dumps({"gap": steps})


@dataclass(frozen=True, slots=True)
class Step:
    """One recorded step."""

    t_ns: int
    events: tuple[Event, ...]
    encoded: dict[str, Any]


@dataclass(frozen=True, slots=True)
class Replay:
    """What came of a replay.

    ``difference`` names the first step whose output is not the recorded one, empty where all
    agree; ``gap`` says why the journal could not be followed to its end.
    """

    start_ns: int
    steps: int
    transitions: tuple[Transition, ...]
    setpoints: int
    difference: str = ""
    gap: str = ""


def read_start(line: str) -> tuple[GateConfig, int]:
    """Settings and time of the start.

    Raises
    ------
    WireError
        If it is not the first line of a journal.
    """
    try:
        data = json.loads(line)
        if data["format"] != JOURNAL_FORMAT:
            raise WireError(f"the journal has format {data['format']!r}", repr(JOURNAL_FORMAT))
        config = with_present_names(GateConfig, data["config"])
        return parse(GateConfig, config), int(data["t_ns"])
    except (ValueError, KeyError, TypeError, ConfigError) as error:
        raise WireError(f"this is no journal of the gate ({error})") from error


def read_steps(lines: Iterable[str]) -> Iterator[Step | int]:
    """Steps of the lines after the first; a number where so many were not written.

    Raises
    ------
    WireError
        If a line is damaged; a torn last one is left out.
    """
    for line in lines:
        if not line.endswith("\n"):
            return
        try:
            data = json.loads(line)
            if "gap" in data:
                yield int(data["gap"])
                continue
            events = tuple(_event(entry) for entry in data["in"])
            yield Step(int(data["t"]), events, data["out"])
        except (ValueError, KeyError, TypeError, IndexError) as error:
            raise WireError(f"a line of the journal is damaged ({error!r})") from error


def replay(lines: Iterable[str]) -> Replay:
    """Put a journal's inputs through a fresh machine and compare the outputs.

    Raises
    ------
    WireError
        If the lines are no journal.
    """
    remaining = iter(lines)
    config, start_ns = read_start(next(remaining, ""))
    machine = GateMachine(config, start_ns)
    count = setpoints = 0
    difference = gap = ""
    transitions: list[Transition] = []
    for step in read_steps(remaining):
        if isinstance(step, int):
            gap = f"{step} or more steps are missing after step {count}"
            break
        output = machine.step(step.t_ns, step.events)
        transitions.extend(output.transitions)
        setpoints += output.setpoint is not None
        # What was read back went through JSON; so must what it is compared with.
        encoded = json.loads(json.dumps(_encode_output(output)))
        if encoded != step.encoded:
            difference = f"step {count} at {step.t_ns} ns: {encoded} instead of {step.encoded}"
            break
        count += 1
    return Replay(start_ns, count, tuple(transitions), setpoints, difference, gap)


def _values(event: Event) -> list[Any]:
    return [dump(getattr(event, field.name)) for field in dataclasses.fields(event)]


def _encode_output(output: GateOutput) -> dict[str, Any]:
    """Outputs of a step that are not empty."""
    encoded: dict[str, Any] = {}
    if (v := output.setpoint) is not None:
        encoded["v"] = [v.forward_m_s, v.right_m_s, v.down_m_s, v.yaw_rad_s]
    if output.mode_request is not None:
        encoded["mode"] = output.mode_request.value
    if output.transitions:
        encoded["to"] = [[t.source, t.target, t.cause, t.detail] for t in output.transitions]
    if output.refusal:
        encoded["refusal"] = output.refusal
    return encoded


def _event(entry: list[Any]) -> Event:
    kind, *values = entry
    names = (field.name for field in dataclasses.fields(EVENT_KINDS[kind]))
    event: Event = rebuild(EVENT_KINDS[kind], dict(zip(names, values, strict=True)))
    return event
