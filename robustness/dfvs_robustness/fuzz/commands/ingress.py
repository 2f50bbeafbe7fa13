"""The way of a command into the gate, in one process: admission, then authority."""

import hashlib
from dataclasses import dataclass, field

from dfvs_core.errors import WireError
from dfvs_core.gate.commands.admission import CommandAdmission
from dfvs_core.gate.commands.authority import Authority, AuthorityAnswer
from dfvs_core.gate.events import Action

KEY = b"k" * 32
VEHICLE = "drone1"
REFUSAL = "rejected: the state forbids it"


@dataclass(frozen=True, slots=True)
class Sending:
    """Bytes that arrive: a command, with a goal where it comes with one."""

    t_ns: int
    command: bytes
    goal: bytes | None = None
    kind: str = ""
    """What the generator meant by it; the judgement does not look at it."""


@dataclass(frozen=True, slots=True)
class CommandEpisode:
    """All that arrives at one ingress, oldest first."""

    born_ns: int
    sendings: list[Sending] = field(default_factory=list)


class Challenges:
    """Challenges as the gate draws them, but the same in every episode."""

    def __init__(self) -> None:
        self._count = 0

    def __call__(self) -> str:
        """Next challenge."""
        self._count += 1
        return hashlib.sha256(b"%d" % self._count).hexdigest()[:32]


@dataclass(frozen=True, slots=True)
class Passed:
    """A command that reached the gate: its bytes there, and the verdict on them."""

    command: bytes
    answer: AuthorityAnswer


class Ingress:
    """Operator link and gate as one, born at a monotonic time."""

    def __init__(self, born_ns: int) -> None:
        self.admission = CommandAdmission(born_ns)
        self.authority = Authority(KEY, VEHICLE, Challenges(), born_ns)

    def challenge(self, now_ns: int) -> str:
        """Challenge that the state publishes."""
        return self.authority.challenge(now_ns)

    def take(self, sending: Sending) -> Passed | None:
        """AuthorityAnswer on what arrives; None where it does not reach the gate.

        A state that forbids to abort stands for the gate's refusals, which replace the answer.
        """
        try:
            if sending.goal is None:
                message = self.admission.admit_command(sending.command, sending.t_ns)
            else:
                _, message = self.admission.admit_goal(sending.goal, sending.command, sending.t_ns)
        except WireError:
            return None
        data = message.payload.encode(errors="replace")
        answer = self.authority.evaluate(data, sending.t_ns)
        if answer.action is Action.ABORT:
            self.authority.record(answer.request, REFUSAL)
        return Passed(data, answer)
