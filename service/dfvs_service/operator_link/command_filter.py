"""Filter of incoming commands by rate and size.

The operator link has no key. It keeps the bytes of a new goal unopened for perception, which reads
them once the gate has accepted the command for it.
"""

from __future__ import annotations

import logging
import threading

from dfvs_core.errors import WireError
from dfvs_core.gate.command import MAX_COMMAND_BYTES, decode_command
from dfvs_core.messages.goal_command import goal_digest
from dfvs_core.messages.link import MAX_DATAGRAM_BYTES, ForwardedCommand, to_datagram
from dfvs_core.messages.rate_limit import Rate, RateLimit
from dfvs_service.goal_store import GoalStore

COMMAND_RATE = Rate(per_s=20.0, burst=20)
GOAL_RATE = Rate(per_s=2.0, burst=4)
"""Goals are large: hashing one takes milliseconds."""
LOG_RATE = Rate(per_s=1.0, burst=20)

log = logging.getLogger("dfvs.operator_link.commands")


class CommandFilter:
    """Takes commands from any thread.

    Parameters
    ----------
    goals : GoalStore
        Where new goals are kept.
    now_ns : int
        Monotonic time.
    """

    def __init__(self, goals: GoalStore, now_ns: int) -> None:
        self._goals = goals
        self._lock = threading.Lock()
        self._commands = RateLimit(COMMAND_RATE, now_ns)
        self._goal_rate = RateLimit(GOAL_RATE, now_ns)
        self._log_rate = RateLimit(LOG_RATE, now_ns)
        self.dropped = 0
        """Commands that were not passed on."""

    def receive_command(self, payload: bytes, now_ns: int) -> ForwardedCommand | None:
        """Message for the gate about a command; None where it is dropped."""
        with self._lock:
            return self._forward(payload, now_ns)

    def receive_goal(self, goal: bytes, command: bytes, now_ns: int) -> ForwardedCommand | None:
        """Message for the gate about a new goal that came with its command; None where dropped."""
        with self._lock:
            if not self._goal_rate.admits(now_ns):
                self._drop("too many goals a second", now_ns)
                return None
            try:
                wanted = decode_command(command).command.argument
            except WireError as error:
                self._drop(str(error), now_ns)
                return None
            if goal_digest(goal) != wanted:
                self._drop("the goal is not the one that its command names", now_ns)
                return None
            try:
                self._goals.keep(wanted, goal)
            except OSError as error:
                self._drop(f"the goal cannot be kept ({error.strerror})", now_ns)
                return None
            return self._forward(command, now_ns)

    def _forward(self, payload: bytes, now_ns: int) -> ForwardedCommand | None:
        if not self._commands.admits(now_ns):
            self._drop("too many commands a second", now_ns)
            return None
        if len(payload) > MAX_COMMAND_BYTES:
            self._drop(f"a command of {len(payload)} bytes", now_ns)
            return None
        message = ForwardedCommand(payload.decode("utf-8", errors="replace"))
        if len(to_datagram(message)) > MAX_DATAGRAM_BYTES:
            self._drop("a command of unprintable bytes", now_ns)
            return None
        return message

    def _drop(self, reason: str, now_ns: int) -> None:
        """Count, and log as long as nobody floods the log with it."""
        self.dropped += 1
        if self._log_rate.admits(now_ns):
            log.warning("command dropped: %s (%d so far)", reason, self.dropped)
