"""Where operators' orders arrive: they are counted, kept small and passed on for the gate to judge.

Perception has no key and believes nothing here. It keeps the bytes of a new goal unopened until
the gate says that the order for it was signed.
"""

from __future__ import annotations

import logging
import threading
from collections import OrderedDict

from dfvs_core.errors import WireError
from dfvs_core.rate_limit import Rate, RateLimit
from dfvs_core.wire.command import MAX_COMMAND_BYTES, decode_command
from dfvs_core.wire.goal_order import goal_digest
from dfvs_core.wire.link import MAX_DATAGRAM_BYTES, ForwardedCommand, to_datagram

COMMAND_RATE = Rate(per_s=20.0, burst=20)
GOAL_RATE = Rate(per_s=2.0, burst=4)
"""Goals are large: hashing one takes milliseconds."""
LOG_RATE = Rate(per_s=1.0, burst=20)
MAX_KEPT_GOALS = 4

log = logging.getLogger("dfvs.perception.orders")


class OrderDesk:
    """Takes orders from any thread.

    Parameters
    ----------
    now_ns : int
        Monotonic time.
    """

    def __init__(self, now_ns: int) -> None:
        self._lock = threading.Lock()
        self._commands = RateLimit(COMMAND_RATE, now_ns)
        self._goal_rate = RateLimit(GOAL_RATE, now_ns)
        self._log_rate = RateLimit(LOG_RATE, now_ns)
        self._goals: OrderedDict[str, bytes] = OrderedDict()
        self.dropped = 0
        """Orders that did not reach the gate."""

    def take_command(self, payload: bytes, now_ns: int) -> ForwardedCommand | None:
        """Message for the gate about a command; None where it is dropped."""
        with self._lock:
            return self._forward(payload, now_ns)

    def take_goal(self, goal: bytes, command: bytes, now_ns: int) -> ForwardedCommand | None:
        """Message for the gate about a new goal that came with its command; None where dropped."""
        with self._lock:
            if not self._goal_rate.admits(now_ns):
                self._drop("too many goals a second", now_ns)
                return None
            try:
                wanted = decode_command(command).argument
            except WireError as error:
                self._drop(str(error), now_ns)
                return None
            if goal_digest(goal) != wanted:
                self._drop("the goal is not the one that its command names", now_ns)
                return None
            self._goals[wanted] = goal
            if len(self._goals) > MAX_KEPT_GOALS:
                self._goals.popitem(last=False)
            return self._forward(command, now_ns)

    def hand_out(self, digest: str) -> bytes:
        """Give away the goal that the gate accepted, and forget the others.

        Raises
        ------
        WireError
            If it never came.
        """
        with self._lock:
            goal = self._goals.get(digest)
            self._goals.clear()
        if goal is None:
            raise WireError(f"goal {digest[:12]!r} is not here")
        return goal

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
            log.warning("order dropped: %s (%d so far)", reason, self.dropped)
