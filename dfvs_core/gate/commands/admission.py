"""Admission of commands to the gate: limited in rate and size, and never believed.

It has no key: what it admits is still for the gate's authority to judge.
"""

from dfvs_core.errors import WireError
from dfvs_core.gate.commands.command import MAX_COMMAND_BYTES, decode_command
from dfvs_core.messages.goal_command import goal_digest
from dfvs_core.messages.link import MAX_DATAGRAM_BYTES, ForwardedCommand, to_datagram
from dfvs_core.messages.rate_limit import Rate, RateLimit

COMMAND_RATE = Rate(per_s=20.0, burst=20)
GOAL_RATE = Rate(per_s=2.0, burst=4)
"""Goals are large: hashing one takes milliseconds."""


class CommandAdmission:
    """Turns what operators send into messages for the gate.

    Parameters
    ----------
    now_ns : int
        Monotonic time.
    """

    def __init__(self, now_ns: int) -> None:
        self._commands = RateLimit(COMMAND_RATE, now_ns)
        self._goals = RateLimit(GOAL_RATE, now_ns)

    def admit_command(self, payload: bytes, now_ns: int) -> ForwardedCommand:
        """Message for the gate about a command.

        Raises
        ------
        WireError
            If the command is one too many or too large.
        """
        if not self._commands.admits(now_ns):
            raise WireError("too many commands a second")
        if len(payload) > MAX_COMMAND_BYTES:
            raise WireError(f"a command of {len(payload)} bytes")
        message = ForwardedCommand(payload.decode("utf-8", errors="replace"))
        if len(to_datagram(message)) > MAX_DATAGRAM_BYTES:
            raise WireError("a command of unprintable bytes")
        return message

    def admit_goal(self, goal: bytes, command: bytes, now_ns: int) -> tuple[str, ForwardedCommand]:
        """Digest of a new goal, and the message for the gate about its command.

        Raises
        ------
        WireError
            If the goal is one too many or not the one that its command names, or if the command
            is not admitted.
        """
        if not self._goals.admits(now_ns):
            raise WireError("too many goals a second")
        digest = decode_command(command).command.argument
        if goal_digest(goal) != digest:
            raise WireError("the goal is not the one that its command names")
        return digest, self.admit_command(command, now_ns)
