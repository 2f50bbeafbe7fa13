"""Episodes of the gate: run, checked step by step, counted, shrunk and kept in files."""

from collections import Counter
from collections.abc import Callable
from dataclasses import dataclass, field, replace
from typing import Any

import numpy as np

from dfvs_core.gate.config import GateConfig
from dfvs_core.gate.events import Event, GateOutput, Report
from dfvs_core.gate.machine import GateMachine
from dfvs_core.gate.replay import EVENT_KINDS
from dfvs_core.messages.schema import dump, rebuild, with_present_names
from dfvs_robustness.fuzz.finding import Finding, InvariantError
from dfvs_robustness.fuzz.gate.episode import Episode, Step, begin_episode
from dfvs_robustness.fuzz.gate.invariants import InvariantChecker
from dfvs_robustness.fuzz.run import Tally, Target, shrink_list

STEPS_PER_EPISODE = 1500
_TWIN_EVERY = 20
"""Every so many episodes are run twice, at another time of day (I7)."""


@dataclass(slots=True)
class GateTally(Tally):
    """Counts of the steps so far; ``moving`` ones sent a setpoint other than zero."""

    steps: int = 0
    kinds: Counter[str] = field(default_factory=Counter)
    states: Counter[str] = field(default_factory=Counter)
    """Steps that ended in each state."""
    transitions: Counter[str] = field(default_factory=Counter)
    causes: Counter[str] = field(default_factory=Counter)
    moving: int = 0
    twins: int = 0

    def see(self, step: Step, output: GateOutput, state: str, moves: bool) -> None:
        """Count one step."""
        self.steps += 1
        self.events += len(step[1])
        self.states[state] += 1
        self.moving += moves
        self.kinds.update([type(event).__name__ for event in step[1]])
        for change in output.transitions:
            self.transitions[f"{change.source} to {change.target}"] += 1
            self.causes[f"{change.target}: {change.cause}"] += 1


def run_episode(seed: tuple[int, int], tally: GateTally) -> Finding[Episode] | None:
    """Run an episode; it is given up to the step that violated an invariant, if one did."""
    episode, surroundings = begin_episode(np.random.default_rng(seed))
    machine = GateMachine(episode.config, episode.born_ns)
    checker = InvariantChecker(episode.config, episode.born_ns)
    outputs = []
    tally.episodes += 1
    try:
        for _ in range(STEPS_PER_EPISODE):
            step = surroundings.next(machine.state)
            episode.steps.append(step)
            output = machine.step(*step)
            checker.check(*step, output, machine.state)
            surroundings.on_output(output)
            outputs.append(output)
            moves = output.setpoint is not None and output.setpoint.speed_m_s > 0.0
            tally.see(step, output, machine.state, moves)
        if seed[1] % _TWIN_EVERY == 0:
            tally.twins += 1
            check_twin(episode, outputs, shift_ns=987_654_321_987)
    except InvariantError as violation:
        return Finding(episode, violation.rule, violation.text)
    return None


def replay_episode(episode: Episode) -> InvariantError | None:
    """Play an episode to a new gate; return the first violation."""
    machine = GateMachine(episode.config, episode.born_ns)
    checker = InvariantChecker(episode.config, episode.born_ns)
    for step in episode.steps:
        output = machine.step(*step)
        try:
            checker.check(*step, output, machine.state)
        except InvariantError as violation:
            return violation
    return None


def shorten(episode: Episode, fails: Callable[[Episode], bool]) -> Episode:
    """Return an episode with as few steps and events as still fail."""

    def steps_fail(steps: list[Step]) -> bool:
        return fails(replace(episode, steps=steps))

    steps = shrink_list(episode.steps, steps_fail)
    for i in range(len(steps)):
        before, (t_ns, events), after = steps[:i], steps[i], steps[i + 1 :]
        few = shrink_list(
            list(events),
            lambda some, before=before, t_ns=t_ns, after=after: steps_fail(  # type: ignore[misc]
                [*before, (t_ns, tuple(some)), *after]
            ),
        )
        steps = [*before, (t_ns, tuple(few)), *after]
    return replace(episode, steps=steps)


def check_twin(episode: Episode, outputs: list[GateOutput], shift_ns: int) -> None:
    """I7: the same episode at another time of day gives the same outputs; else InvariantError."""
    twin = GateMachine(episode.config, episode.born_ns + shift_ns)
    for (t_ns, events), output in zip(episode.steps, outputs, strict=True):
        again = twin.step(t_ns + shift_ns, [_shifted(e, shift_ns) for e in events])
        same = (
            again.setpoint == output.setpoint
            and again.mode_request is output.mode_request
            and [t.cause for t in again.transitions] == [t.cause for t in output.transitions]
        )
        if not same:
            raise InvariantError("I7", f"{output} at one time of day, {again} at another")


def _shifted(event: Event, shift_ns: int) -> Event:
    if isinstance(event, Report):
        capture_ns = event.report.t_capture_ns + shift_ns
        report = replace(event.report, t_capture_ns=capture_ns)
        return Report(event.t_ns + shift_ns, report)
    return replace(event, t_ns=event.t_ns + shift_ns)


def _dump(episode: Episode) -> dict[str, Any]:
    return {
        "config": dump(episode.config),
        "born_ns": episode.born_ns,
        "steps": [[t_ns, [_dump_event(e) for e in events]] for t_ns, events in episode.steps],
    }


def _dump_event(event: Event) -> dict[str, Any]:
    return {"event": type(event).__name__, **dump(event)}


def _load_event(data: dict[str, Any]) -> Event:
    event: Event = rebuild(EVENT_KINDS[data["event"]], data)
    return event


def _episode(document: dict[str, Any]) -> Episode:
    steps = [(int(t_ns), tuple(map(_load_event, some))) for t_ns, some in document["steps"]]
    config = rebuild(GateConfig, with_present_names(GateConfig, document["config"]))
    return Episode(config, int(document["born_ns"]), steps)


_FILES = ("dfvs-gate-replay/1", _dump, _episode)
GATE = Target(GateTally, run_episode, replay_episode, shorten, *_FILES)
