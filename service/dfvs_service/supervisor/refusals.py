"""Checks that keep the gate in PREFLIGHT, as lines for the user and for the flight's log."""

import re

from dfvs_core.gate.config import S
from dfvs_core.gate.states import GateState
from dfvs_service.supervisor.heartbeat import Heartbeat

_STANDING_NS = 3 * S
_CHANGING_NS = 30 * S
_NUMBER = re.compile(r"-?\d+(\.\d+)?")


class StandingRefusals:
    """Says what refuses, with its remedies, once it has stood for 3 s; numbers may change.

    Of reasons that keep changing it says the present one every 30 s.
    """

    def __init__(self) -> None:
        self._words = self._told = ""
        self._since_ns = 0
        self._told_ns: int | None = None

    def update(self, heartbeat: Heartbeat) -> str:
        """Line to tell now, empty where there is none; takes the newest state."""
        now_ns = heartbeat.t_ns
        if heartbeat.state != GateState.PREFLIGHT:
            self._words = self._told = ""
            self._told_ns = None
            return ""
        if self._told_ns is None:
            self._told_ns = now_ns
        refusing = (check for check in heartbeat.checks if check.refuses)
        line = "; ".join(f"{c.name}: {c.detail} ({c.remedy})" for c in refusing)
        words = _NUMBER.sub("", line)
        if words != self._words:
            self._words, self._since_ns = words, now_ns
        stands = now_ns - self._since_ns >= _STANDING_NS
        is_due = stands or now_ns - self._told_ns >= _CHANGING_NS
        if words in ("", self._told) or not is_due:
            return ""
        self._told, self._told_ns = words, now_ns
        return f"not ready: {line}"
