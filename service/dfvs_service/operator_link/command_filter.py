"""Filter of incoming commands: passes on what is admitted, counts and logs what is not.

The operator link keeps the bytes of a new goal unopened for perception, which reads them once the
gate has accepted the command for it.
"""

import logging
import threading

from dfvs_core.errors import WireError
from dfvs_core.gate.commands.admission import CommandAdmission
from dfvs_core.messages.link import ForwardedCommand
from dfvs_core.messages.rate_limit import Rate, RateLimit
from dfvs_service.goal_store import GoalStore

LOG_RATE = Rate(per_s=1.0, burst=20)

log = logging.getLogger("dfvs.operator_link.commands")


class CommandFilter:
    """Takes commands from any thread."""

    def __init__(self, goals: GoalStore, now_ns: int) -> None:
        self._goals = goals
        self._lock = threading.Lock()
        self._admission = CommandAdmission(now_ns)
        self._log_rate = RateLimit(LOG_RATE, now_ns)
        self.dropped = 0
        """Commands that were not passed on."""

    def receive_command(self, payload: bytes, now_ns: int) -> ForwardedCommand | None:
        """Message for the gate about a command; None where it is dropped."""
        with self._lock:
            try:
                return self._admission.admit_command(payload, now_ns)
            except WireError as error:
                self._drop(str(error), now_ns)
            return None

    def receive_goal(self, goal: bytes, command: bytes, now_ns: int) -> ForwardedCommand | None:
        """Message for the gate about a new goal that came with its command; None where dropped."""
        with self._lock:
            try:
                digest, message = self._admission.admit_goal(goal, command, now_ns)
                self._goals.keep(digest, goal)
            except WireError as error:
                self._drop(str(error), now_ns)
                return None
            except OSError as error:
                self._drop(f"the goal cannot be kept ({error.strerror})", now_ns)
                return None
            return message

    def _drop(self, reason: str, now_ns: int) -> None:
        """Count, and log as long as nobody floods the log with it."""
        self.dropped += 1
        if self._log_rate.admits(now_ns):
            log.warning("command dropped: %s (%d so far)", reason, self.dropped)
