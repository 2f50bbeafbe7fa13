"""Service processes in watch-only mode, which sends nothing to the vehicle."""

import dataclasses
import time
from collections.abc import Callable

from dfvs_core.gate.checks.preflight import Check
from dfvs_core.gate.config import Engage
from dfvs_core.gate.states import GateState
from dfvs_service.settings.config import ServiceConfig
from dfvs_service.supervisor.heartbeat import Heartbeat

_FOR_EVER_S = 600.0


def watching(config: ServiceConfig) -> ServiceConfig:
    """Settings with which nothing is sent to the vehicle, and nothing gives up early."""
    gate = dataclasses.replace(config.gate, engage=Engage.NEVER, exit_when_done=False)
    vehicle = dataclasses.replace(config.vehicle, timeout_s=_FOR_EVER_S)
    camera = dataclasses.replace(config.camera, timeout_s=_FOR_EVER_S)
    record = dataclasses.replace(config.record, folder="")
    return dataclasses.replace(config, gate=gate, vehicle=vehicle, camera=camera, record=record)


class Observer:
    """Display that keeps the newest list of checks, and ends the service when it has seen enough.

    Parameters
    ----------
    timeout_s : float
        How long checks may fail until their crosses count.
    clock : callable
        Monotonic time, s.
    """

    def __init__(self, timeout_s: float, clock: Callable[[], float] = time.monotonic) -> None:
        self._clock = clock
        self._deadline_s = clock() + timeout_s
        self.checks: tuple[Check, ...] = ()
        self.lines: list[str] = []
        """What the processes had to say."""
        self.is_done = False
        self.end: Callable[[], None] = lambda: None
        """Called once, when enough was seen."""

    def show(self, heartbeat: Heartbeat) -> None:
        """Take the newest state; all checks have passed for a second when it is READY."""
        if self.is_done:
            return
        if heartbeat.checks:
            self.checks = heartbeat.checks
        ready = heartbeat.state == str(GateState.READY)
        if ready or self._clock() >= self._deadline_s:
            self.is_done = True
            self.end()

    def log(self, line: str) -> None:
        """Keep a line."""
        self.lines.append(line)

    def close(self) -> None:
        """Nothing to clean."""
