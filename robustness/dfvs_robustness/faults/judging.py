"""What was recorded of a case, and whether the reaction was right and in time."""

from __future__ import annotations

import dataclasses
import itertools
import math
from dataclasses import dataclass

from dfvs_core.gate.states import Cause, GateState
from dfvs_robustness.faults.fault import UNFIT, Fault, Outcome, Reaction
from dfvs_robustness.harness.harness import Harness
from dfvs_robustness.harness.records import Event, is_ours, moves

MS = 1_000_000
S = GateState

_TOOK = "took"
_LATE = (Cause.FRAME_OLD, Cause.RESULT_LATE)
_TOO_FEW = " a second, results "
"""How the checks begin to say that good frames are too few; so they are where all are bad."""

_BRAKED = (Reaction.HOLD, Reaction.ABORT, Reaction.EXIT)
"""Reactions that zero setpoints are part of; silence in their place lets the vehicle move on."""

_MOVES = (S.SERVO, S.DONE)
"""States in which the vehicle moves; in others zeros have been sent already."""

_HELD_AFTER = {S.ENGAGE: (S.ENGAGE, S.HOLD), S.SERVO: (S.HOLD,), S.DONE: (S.HOLD,)}
"""States that a fault that asks for HOLD may lead to; DONE holds the goal by vision."""

_TARGETS = {
    Reaction.HOLD: S.HOLD,
    Reaction.ABORT: S.ABORT,
    Reaction.RELEASED: S.RELEASED,
    Reaction.EXIT: S.ABORT,
}


@dataclass(frozen=True, slots=True)
class Oracle:
    """Everything that was recorded since the fault."""

    setpoints: list[Event]
    mode_commands: list[Event]
    transitions: list[Event]
    state: GateState
    is_running: bool
    over_ns: int
    environment_late_ns: int = 0
    """Longest time for which the simulated vehicle itself did nothing."""
    must_leave: bool = False
    """The fault lasted long enough in READY for the checks to refuse."""

    @classmethod
    def collect(
        cls, harness: Harness, since_ns: int, over_ns: int, *, must_leave: bool = False
    ) -> Oracle:
        """Read the records of a harness."""
        recent = [e for e in harness.environment.events[-20_000:] if e["t_ns"] >= since_ns]
        ours = [e for e in recent if is_ours(e)]
        return cls(
            [e for e in ours if e["kind"] == "setpoint"],
            [e for e in ours if e["kind"] == "mode_command"],
            harness.service.log.transitions(since_ns),
            harness.state,
            harness.service.is_running(),
            over_ns,
            max((e["by_ns"] for e in recent if e["kind"] == "world_late"), default=0),
            must_leave,
        )

    def was_late(self) -> bool:
        """Whether a frame or its result was too old at some time."""
        return any(t["cause"] in _LATE for t in self.transitions)

    def stopped_ns(self, t0_ns: int) -> int:
        """When the first zero, or else the silence, after the last motion came.

        ``t0_ns`` where nothing moved since then.
        """
        moving = [s["t_ns"] for s in self.setpoints if moves(s) and s["t_ns"] > t0_ns]
        if not moving:
            return t0_ns
        zeros = [s["t_ns"] for s in self.setpoints if s["t_ns"] > moving[-1]]
        return int(zeros[0] if zeros else moving[-1])

    @property
    def ends_at_zero(self) -> bool:
        """Whether the last setpoint of all is zero; False where there is none."""
        return bool(self.setpoints) and not moves(self.setpoints[-1])

    def longest_gap_ns(self) -> int:
        """Longest time between two setpoints, or from the last one to the end of the case."""
        times = [*(s["t_ns"] for s in self.setpoints), self.over_ns]
        return max((b - a for a, b in itertools.pairwise(times)), default=0)

    def cause(self, target: GateState | None = None) -> str:
        """Why the gate first changed its state, or first changed to ``target``; else empty."""
        for t in self.transitions:
            if target is None or t["target"] == target:
                return f"{t['cause']}: {t['detail']}" if t["detail"] else str(t["cause"])
        return ""

    def into(self, state: GateState) -> int | None:
        """When a state was entered."""
        times = [t["t_ns"] for t in self.transitions if t["target"] == state]
        return times[0] if times else None


def judge(fault: Fault, state: GateState, seed: int, t0_ns: int, seen: Oracle) -> Outcome:
    """Tell whether the reaction was right and in time."""
    has_moved = state in _MOVES or any(moves(s) for s in seen.setpoints)
    must_brake = fault.reaction in _BRAKED and not fault.cuts_link and has_moved
    if fault.reaction is Reaction.ENDED:
        is_released = seen.into(S.ABORT) is None and seen.into(S.RELEASED) is not None
        which = Reaction.RELEASED if is_released else Reaction.ABORT
        fault = dataclasses.replace(fault, reaction=which)
    reaction_ns, problem = _reaction(fault, state, t0_ns, seen)
    if must_brake and not seen.ends_at_zero:
        problem = problem or "the setpoints ended without a zero"
    problem = problem or _misnamed(fault, state, seen)
    reaction_ms = max(reaction_ns - t0_ns, 0) / MS if reaction_ns is not None else math.inf
    cause = seen.cause(_TARGETS.get(fault.reaction)) or seen.cause()
    outcome = Outcome(fault.name, str(state), seed, not problem, reaction_ms, cause, problem)
    return timed(outcome, fault)


def _misnamed(fault: Fault, state: GateState, seen: Oracle) -> str:
    """Say that the gate reacted, but for another reason than this fault."""
    target = S.PREFLIGHT if state is S.READY else _TARGETS.get(fault.reaction)
    cause = "" if target is None else seen.cause(target)
    if not fault.says or not cause or any(words in cause for words in fault.says):
        return ""
    is_frame = fault.reaction is Reaction.HOLD
    is_late = is_frame and any(late in cause for late in (*_LATE, _TOO_FEW))
    return "" if is_late else f"the gate said {cause!r}"


def timed(outcome: Outcome, fault: Fault) -> Outcome:
    """Judge by the fault's limit what was judged right otherwise."""
    if outcome.problem and not outcome.problem.startswith(_TOOK):
        return outcome
    late = outcome.reaction_ms > fault.limit_ms
    problem = f"{_TOOK} {outcome.reaction_ms:.0f} ms, {fault.limit_ms:g} ms allowed" if late else ""
    return dataclasses.replace(outcome, passed=not late, problem=problem)


def _reaction(fault: Fault, state: GateState, t0_ns: int, seen: Oracle) -> tuple[int | None, str]:
    """When the reaction was complete, and what was wrong with it."""
    stopped_ns = seen.stopped_ns(t0_ns)
    silent_ns = max((s["t_ns"] for s in seen.setpoints), default=t0_ns)
    if state is S.READY and fault.reaction in UNFIT:
        return stopped_ns, _unfit_problem(seen)
    if fault.reaction is Reaction.IGNORED:
        return t0_ns, "" if seen.state is state else f"the gate went to {seen.state}"
    if fault.reaction is Reaction.STREAM:
        return t0_ns + seen.longest_gap_ns(), "" if len(seen.setpoints) > 10 else "no setpoints"
    if fault.reaction is Reaction.SILENCE:
        return silent_ns, "the service still runs" if seen.is_running else ""
    if fault.reaction is Reaction.EXIT:
        return max(seen.over_ns, stopped_ns), _exit_problem(state, seen)
    if fault.reaction is Reaction.REFUSED:
        is_right = seen.state is S.PREFLIGHT
        return t0_ns, "" if is_right else f"the gate is in {seen.state}"
    if fault.reaction is Reaction.HOLD:
        right = _HELD_AFTER.get(state, (state,))
        return stopped_ns, "" if seen.state in right else f"the gate is in {seen.state}"
    target = S.RELEASED if fault.reaction is Reaction.RELEASED else S.ABORT
    entered_ns = seen.into(target)
    if entered_ns is None:
        return None, f"the gate never went to {target}, it is in {seen.state}"
    if target is S.RELEASED:
        asked = [m for m in seen.mode_commands if m["t_ns"] > t0_ns]
        return silent_ns, f"asked for {asked[0]['mode']} after the takeover" if asked else ""
    return max(entered_ns, stopped_ns), ""


def _exit_problem(state: GateState, seen: Oracle) -> str:
    """Say what was wrong with an end of the service that was asked for."""
    if seen.is_running:
        return "the service still runs"
    held = any(m["mode"] == "HOLD" for m in seen.mode_commands)
    is_offboard = state in (S.SERVO, S.HOLD, S.DONE)  # in ENGAGE perhaps not yet
    return "the vehicle was not given back to Hold" if is_offboard and not held else ""


def _unfit_problem(seen: Oracle) -> str:
    """Say what was wrong with the reaction of checks that must refuse."""
    if seen.must_leave and seen.into(S.PREFLIGHT) is None:
        return f"the checks went on to pass, the gate is in {seen.state}"
    return "" if seen.state in (S.READY, S.PREFLIGHT) else f"the gate went to {seen.state}"
