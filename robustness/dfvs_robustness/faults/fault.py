"""What a fault of the matrix is, and what comes of a case."""

import enum
from collections.abc import Callable
from dataclasses import dataclass, field

import numpy as np

from dfvs_core.gate.states import GateState
from dfvs_robustness.harness.harness import Harness
from dfvs_robustness.harness.setup import Setup

NO_VERDICT = "no verdict"


class Reaction(enum.Enum):
    """What must follow a fault."""

    HOLD = "zero, HOLD"
    ABORT = "zero, ABORT"
    RELEASED = "silence, RELEASED"
    ENDED = "zero, ABORT or RELEASED"
    """The autopilot leaves OFFBOARD for it as well: what the gate receives first decides."""
    SILENCE = "silence"
    EXIT = "zero, Hold, end"
    STREAM = "setpoints go on"
    REFUSED = "not engaged"
    IGNORED = "nothing changes"


UNFIT = (Reaction.HOLD, Reaction.ABORT, Reaction.ENDED)
"""Reactions to what the checks must refuse, where nothing is engaged yet."""

Inject = Callable[[Harness, np.random.Generator], int | None]
"""Does it; returns when (monotonic ns), None where the last good frame's capture counts."""


@dataclass(frozen=True, slots=True)
class Fault:
    """One way in which something goes wrong.

    ``seen_by`` says by what it is detected, ``says`` what the gate's own reason for its change of
    state must hold, one of them, so that no other detector stands in for that one. ``limit_ms`` is
    the longest time from the fault to the reaction (for STREAM the longest gap). ``watch_s`` is
    how long a fault without a change of state is kept up. ``restarts`` tells that the service does
    not survive it, ``spares_frames`` that it makes no frame late: where frames are late all the
    same, the machine is too busy for a verdict. ``alone`` tells that it disturbs what else runs on
    the machine, ``cuts_link`` that the vehicle receives nothing from then on, no zero either.
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
    cuts_link: bool = False
    says: tuple[str, ...] = ()


@dataclass(frozen=True, slots=True)
class Case:
    """One cell of the matrix with one seed."""

    fault: str
    state: str
    seed: int


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
