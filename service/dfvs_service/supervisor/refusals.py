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

    Of reasons that keep changing it says the present ones every 30 s. One that was told, went and
    came back within 30 s is not told again.
    """

    def __init__(self) -> None:
        self._present = frozenset[str]()
        self._told: dict[str, int] = {}  # what was told, and when it refused last
        self._since_ns = 0
        self._told_ns: int | None = None

    def update(self, heartbeat: Heartbeat) -> str:
        """Line to tell now, empty where there is none; takes the newest state."""
        now_ns = heartbeat.t_ns
        if heartbeat.state != GateState.PREFLIGHT:
            self._present, self._told, self._told_ns = frozenset(), {}, None
            return ""
        if self._told_ns is None:
            self._told_ns = now_ns
        lines = [f"{c.name}: {c.detail} ({c.remedy})" for c in heartbeat.checks if c.refuses]
        present = frozenset(_NUMBER.sub("", line) for line in lines)
        if present != self._present:
            self._present, self._since_ns = present, now_ns
        self._told |= dict.fromkeys(present & self._told.keys(), now_ns)
        self._told = {w: t for w, t in self._told.items() if now_ns - t < _CHANGING_NS}
        stands = now_ns - self._since_ns >= _STANDING_NS
        is_due = stands or now_ns - self._told_ns >= _CHANGING_NS
        if present <= self._told.keys() or not is_due:
            return ""
        self._told |= dict.fromkeys(present, now_ns)
        self._told_ns = now_ns
        return f"not ready: {'; '.join(lines)}"
