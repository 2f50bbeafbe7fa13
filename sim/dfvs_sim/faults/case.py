"""A case: one fault in one state of the gate with one seed, and what came of it."""

from __future__ import annotations

import dataclasses
import enum
import itertools
import math
import time
import zlib
from collections.abc import Callable
from dataclasses import dataclass, field

import numpy as np

from dfvs_core.gate.states import Cause, GateState
from dfvs_sim.faults.records import Event, is_ours, moves
from dfvs_sim.faults.rig import Rig, Setup
from dfvs_sim.faults.service import HarnessError, wait_until
from dfvs_sim.faults.ways import bring_to

MS = 1_000_000
S = GateState

NO_VERDICT = "no verdict"
_TOOK = "took"
_SETTLE_S = 0.3
_SHORT_SETTLE_S, _SHORT_SHARE = 0.1, 0.75
"""READY is left after half a second of failing checks; most faults there are shorter than that."""
_PHASE_S = 0.2
"""Faults come at any phase of frames (0.07 s) and of telemetry (0.05 s)."""
_LATE_S = 3.0
"""Over the limit a case is watched for so long, to tell late from never."""

_LATE = (str(Cause.FRAME_OLD), str(Cause.RESULT_LATE))

CAPTURE_MS = 350.0
"""From the capture of the last good frame to zero at most; 300 ms in 99 of 100 cases."""

ANY_ENGAGED = (S.ENGAGE, S.SERVO, S.HOLD, S.DONE)
FLYING = (S.ENGAGE, S.SERVO, S.HOLD)


class Reaction(enum.Enum):
    """What must follow a fault."""

    HOLD = "zero, HOLD"
    ABORT = "zero, ABORT"
    RELEASED = "silence, RELEASED"
    SILENCE = "silence"
    EXIT = "zero, Hold, end"
    STREAM = "setpoints go on"
    REFUSED = "not engaged"
    IGNORED = "nothing changes"


Inject = Callable[[Rig, np.random.Generator], int | None]
"""Does it; returns when (monotonic ns), None where the last good frame's capture counts."""


@dataclass(frozen=True, slots=True)
class Fault:
    """One way in which something goes wrong.

    ``seen_by`` says by what it is detected; ``limit_ms`` is the longest time from the fault to
    the reaction (for STREAM the longest gap). ``watch_s`` is how long a fault without a change of
    state is kept up. ``restarts`` tells that the service does not survive it, ``spares_frames``
    that it makes no frame late: where frames are late all the same, the machine is too busy for a
    verdict. ``alone`` tells that it disturbs what else runs on the machine.
    """

    name: str
    what: str
    seen_by: str
    reaction: Reaction
    limit_ms: float
    states: tuple[GateState, ...]
    inject: Inject
    setup: Setup = field(default_factory=Setup)
    watch_s: float = 0.4
    restarts: bool = False
    spares_frames: bool = False
    alone: bool = False


@dataclass(frozen=True, slots=True)
class Outcome:
    """What came of a case; ``cause`` is the gate's own word for it."""

    fault: str
    state: str
    seed: int
    passed: bool
    reaction_ms: float
    cause: str
    problem: str = ""
    attempts: int = 1

    @property
    def has_verdict(self) -> bool:
        """Whether the case came to its end; one that did not counts as failed, until run again."""
        return not self.problem.startswith(NO_VERDICT)


def run_case(rig: Rig, fault: Fault, state: GateState, seed: int) -> Outcome:
    """Bring the gate to the state, let the fault happen, and judge.

    Raises
    ------
    HarnessError
        If the state cannot be reached, or the machine was too busy for a verdict.
    """
    rng = np.random.default_rng([seed, zlib.crc32(fault.name.encode()), list(S).index(state)])
    rig.places = rng
    bring_to(rig, state)
    time.sleep(float(rng.uniform(0.0, _PHASE_S)))
    if rig.state is not state:
        raise HarnessError(f"the gate went to {rig.state} before the fault")
    begin_ns = rig.world.note("fault", name=fault.name, state=str(state), seed=seed)
    t0_ns = fault.inject(rig, rng)
    settle_s = _SETTLE_S
    if state is S.READY and fault.reaction is Reaction.HOLD and rng.random() < _SHORT_SHARE:
        settle_s = _SHORT_SETTLE_S
    over_ns = _watch(rig, fault, state, settle_s)
    if t0_ns is None:
        t0_ns = rig.camera.last_good_ns
    evidence = Evidence.collect(rig, begin_ns, over_ns)
    if fault.spares_frames and evidence.was_late():
        raise HarnessError("frames were late by themselves: the machine is too busy")
    outcome = judge(fault, state, seed, t0_ns, evidence)
    if not outcome.passed and evidence.world_late_ns:
        raise HarnessError(f"the vehicle stood still for {evidence.world_late_ns / MS:.0f} ms")
    return outcome


def _watch(rig: Rig, fault: Fault, state: GateState, settle_s: float) -> int:
    """Wait until the reaction has come, or cannot come in time any more; when that was."""
    limit_s = fault.limit_ms / 1000 + _LATE_S
    ends = {
        Reaction.ABORT: lambda: rig.state is S.ABORT,
        Reaction.RELEASED: lambda: rig.state is S.RELEASED,
        Reaction.EXIT: lambda: not rig.service.is_running(),
        Reaction.SILENCE: lambda: not rig.service.is_running(),
    }
    nothing_flies = fault.reaction is Reaction.ABORT and state is S.READY
    if fault.reaction in ends and not nothing_flies:
        wait_until(ends[fault.reaction], limit_s)
        over_ns = time.monotonic_ns()
        time.sleep(_SETTLE_S)
        return over_ns
    else:
        time.sleep(max(fault.watch_s, fault.limit_ms / 1000 + settle_s))
    return time.monotonic_ns()


@dataclass(frozen=True, slots=True)
class Evidence:
    """Everything that was recorded since the fault."""

    setpoints: list[Event]
    mode_commands: list[Event]
    transitions: list[Event]
    state: GateState
    is_running: bool
    over_ns: int
    world_late_ns: int = 0
    """Longest time for which the simulated vehicle itself did nothing."""

    @classmethod
    def collect(cls, rig: Rig, since_ns: int, over_ns: int) -> Evidence:
        """Read the records of a rig."""
        recent = [e for e in rig.world.events[-20_000:] if e["t_ns"] >= since_ns]
        ours = [e for e in recent if is_ours(e)]
        return cls(
            [e for e in ours if e["kind"] == "setpoint"],
            [e for e in ours if e["kind"] == "mode_command"],
            rig.service.log.transitions(since_ns),
            rig.state,
            rig.service.is_running(),
            over_ns,
            max((e["by_ns"] for e in recent if e["kind"] == "world_late"), default=0),
        )

    def was_late(self) -> bool:
        """Whether a frame or its result was too old at some time."""
        return any(t["cause"] in _LATE for t in self.transitions)

    def stopped_ns(self, t0_ns: int) -> int:
        """When the first zero after the last motion came; t0_ns where nothing moved since then."""
        moving = [s["t_ns"] for s in self.setpoints if moves(s) and s["t_ns"] > t0_ns]
        if not moving:
            return t0_ns
        zeros = [s["t_ns"] for s in self.setpoints if s["t_ns"] > moving[-1]]
        return int(zeros[0] if zeros else moving[-1])

    def longest_gap_ns(self) -> int:
        """Longest time between two setpoints."""
        times = [s["t_ns"] for s in self.setpoints]
        return max((b - a for a, b in itertools.pairwise(times)), default=0)

    def cause(self) -> str:
        """Why the gate first changed its state."""
        if not self.transitions:
            return ""
        first = self.transitions[0]
        return f"{first['cause']}: {first['detail']}" if first["detail"] else str(first["cause"])

    def into(self, state: GateState) -> int | None:
        """When a state was entered."""
        times = [t["t_ns"] for t in self.transitions if t["target"] == state]
        return times[0] if times else None


def judge(fault: Fault, state: GateState, seed: int, t0_ns: int, seen: Evidence) -> Outcome:
    """Tell whether the reaction was right and in time."""
    reaction_ns, problem = _reaction(fault, state, t0_ns, seen)
    reaction_ms = max(reaction_ns - t0_ns, 0) / MS if reaction_ns is not None else math.inf
    outcome = Outcome(fault.name, str(state), seed, not problem, reaction_ms, seen.cause(), problem)
    return timed(outcome, fault)


def timed(outcome: Outcome, fault: Fault) -> Outcome:
    """Judge by the fault's limit what was judged right otherwise."""
    if outcome.problem and not outcome.problem.startswith(_TOOK):
        return outcome
    late = outcome.reaction_ms > fault.limit_ms
    problem = f"{_TOOK} {outcome.reaction_ms:.0f} ms, {fault.limit_ms:g} ms allowed" if late else ""
    return dataclasses.replace(outcome, passed=not late, problem=problem)


def _reaction(fault: Fault, state: GateState, t0_ns: int, seen: Evidence) -> tuple[int | None, str]:
    """When the reaction was complete, and what was wrong with it."""
    stopped_ns = seen.stopped_ns(t0_ns)
    silent_ns = max((s["t_ns"] for s in seen.setpoints), default=t0_ns)
    if fault.reaction is Reaction.IGNORED:
        return t0_ns, "" if seen.state is state else f"the gate went to {seen.state}"
    if fault.reaction is Reaction.STREAM:
        return t0_ns + seen.longest_gap_ns(), "" if len(seen.setpoints) > 10 else "no setpoints"
    if fault.reaction is Reaction.SILENCE:
        return silent_ns, "the service still runs" if seen.is_running else ""
    if fault.reaction is Reaction.EXIT:
        return max(seen.over_ns, stopped_ns), "the service still runs" if seen.is_running else ""
    if fault.reaction is Reaction.REFUSED:
        is_right = seen.state is S.PREFLIGHT
        return t0_ns, "" if is_right else f"the gate is in {seen.state}"
    if state is S.READY:
        is_right = seen.state in (S.READY, S.PREFLIGHT)
        return stopped_ns, "" if is_right else f"the gate went to {seen.state}"
    if fault.reaction is Reaction.HOLD:
        right = {S.SERVO: (S.HOLD,), S.ENGAGE: (S.ENGAGE, S.HOLD)}.get(state, (state,))
        return stopped_ns, "" if seen.state in right else f"the gate is in {seen.state}"
    target = S.RELEASED if fault.reaction is Reaction.RELEASED else S.ABORT
    entered_ns = seen.into(target)
    if entered_ns is None:
        return None, f"the gate never went to {target}, it is in {seen.state}"
    if target is S.RELEASED:
        asked = [m for m in seen.mode_commands if m["t_ns"] > t0_ns]
        return silent_ns, f"asked for {asked[0]['mode']} after the takeover" if asked else ""
    return max(entered_ns, stopped_ns), ""
