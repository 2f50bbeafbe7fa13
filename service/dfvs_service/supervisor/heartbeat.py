"""Heartbeats of the gate to its parent, and the detector of a hang by their absence."""

from dataclasses import dataclass

from dfvs_core.gate.checks.preflight import Check
from dfvs_core.gate.config import MS

HEARTBEAT_LIMIT_NS = 300 * MS
STARTUP_LIMIT_NS = 60_000 * MS
OWN_PAUSE_NS = 100 * MS
MOST_PAUSES_NS = 1000 * MS
"""Pauses of the watcher itself that are allowed for between two heartbeats."""


@dataclass(frozen=True, slots=True)
class Heartbeat:
    """Sign of life of the gate's loop, with what the user may want to see of it."""

    t_ns: int
    state: str
    cause: str
    error_m: float | None = None
    error_rad: float | None = None
    reached: bool = False
    warnings: tuple[str, ...] = ()
    checks: tuple[Check, ...] = ()
    """Preflight list, while not engaged."""


class HangDetector:
    """Judges a process by the time since its last heartbeat.

    Before the first one only ``STARTUP_LIMIT_NS`` counts: imports can be slow. A watcher that
    was itself away (a suspended or starved machine) does not blame the watched for that time,
    until its pauses since the last heartbeat add up to ``MOST_PAUSES_NS``.

    ``now_ns`` is the monotonic time at which the process was started.
    """

    def __init__(self, now_ns: int) -> None:
        self._alive_ns = now_ns
        self._looked_ns = now_ns
        self._paused_ns = 0
        self._has_heartbeat = False

    def on_heartbeat(self, now_ns: int) -> None:
        """Take a heartbeat that was received now."""
        self._has_heartbeat = True
        self._alive_ns = now_ns
        self._paused_ns = 0

    def is_overdue(self, now_ns: int) -> bool:
        """Look whether the process has to be taken for hung; to be called often."""
        pause_ns = now_ns - self._looked_ns
        if pause_ns > OWN_PAUSE_NS and self._paused_ns < MOST_PAUSES_NS:
            self._alive_ns += pause_ns
            self._paused_ns += pause_ns
        self._looked_ns = now_ns
        limit_ns = HEARTBEAT_LIMIT_NS if self._has_heartbeat else STARTUP_LIMIT_NS
        return now_ns - self._alive_ns > limit_ns
