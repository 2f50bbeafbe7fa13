"""Preflight check: first this machine, then camera and vehicle."""

import dataclasses
import signal
import time
from collections.abc import Callable, Sequence
from pathlib import Path

from dfvs_core.errors import DfvsError
from dfvs_core.gate.checks.preflight import Check
from dfvs_core.gate.config import Engage
from dfvs_core.gate.states import GateState
from dfvs_core.geometry.arrays import ImageArray
from dfvs_core.messages.goal import Goal
from dfvs_core.messages.topics import Topics
from dfvs_service.perception.assembly import flow_matcher
from dfvs_service.perception.working_size import with_working_size
from dfvs_service.preflight.calibration import camera_checks
from dfvs_service.preflight.ground import (
    command_check,
    device_check,
    error_check,
    model_check,
    speed_check,
)
from dfvs_service.preflight.image import draw_image
from dfvs_service.preflight.live_view import LiveView
from dfvs_service.preflight.report import CheckReport
from dfvs_service.preflight.stream import stream_checks
from dfvs_service.settings.config import ServiceConfig
from dfvs_service.settings.exposure import exposure_checks
from dfvs_service.settings.runtime import RuntimeFolder
from dfvs_service.supervisor.heartbeat import Heartbeat
from dfvs_service.supervisor.parent import Parent, Programs, prepare_runtime, supervise
from dfvs_service.zenoh_session import inner_zenoh

_ERROR = "error: "
_CRASHED = "check once more with --runtime-dir DIR: all that its processes said is in DIR/*.err"
_FOR_EVER_S = 600.0


def check_camera_and_model(config: ServiceConfig, problem: DfvsError) -> CheckReport:
    """Report where camera and goal do not fit together, so that nothing can be started."""
    model, _ = model_check(config)
    missing = Check("vehicle", False, "not checked", "correct the camera's settings first")
    checks = (error_check("camera", problem), model, *_settings_checks(config), missing)
    return CheckReport(config.vehicle.name, checks)


def check_everything(
    config: ServiceConfig,
    route: Sequence[tuple[Path, Goal]],
    runtime: RuntimeFolder,
    timeout_s: float,
    show: Callable[[ImageArray], None] | None = None,
) -> CheckReport:
    """Check the live camera, model and settings, then watch camera and vehicle for a while.

    The camera is checked against every goal of the route, the rest against the first.
    ``show`` takes an image (H, W, 3) of what was seen; there is none where no model works.

    Raises
    ------
    DfvsError
        If the processes cannot run, such as when a port is taken.
    """
    _, goal = route[0]
    camera = (*camera_checks(config, route), *stream_checks(config, goal))
    model, matcher = model_check(config)
    first = (*camera, model)
    if matcher is None:
        missing = Check("vehicle", False, "not checked", "correct the model first")
        return CheckReport(config.vehicle.name, (*first, *_settings_checks(config), missing))
    chosen = with_working_size(config, goal, matcher, time.monotonic_ns)
    if chosen != config:
        config, matcher = chosen, flow_matcher(chosen.flow)
    speed = speed_check(config, matcher, goal, time.monotonic_ns)
    topics = Topics(config.vehicle.name)
    live = None if show is None else LiveView(inner_zenoh(config.zenoh, runtime), topics)
    try:
        found = _watch(config, goal, runtime, timeout_s)
    finally:
        view = None if live is None else live.close()
    if show is not None and view is not None:
        show(draw_image(goal.image, view, config.servo.min_confidence))
    checks = (*first, speed, *_settings_checks(config), *found)
    return CheckReport(config.vehicle.name, checks)


def _settings_checks(config: ServiceConfig) -> tuple[Check, ...]:
    zenoh, mavlink = exposure_checks(config)
    return (zenoh, device_check(config) or mavlink, command_check(config))


def _watch(
    config: ServiceConfig, goal: Goal, runtime: RuntimeFolder, timeout_s: float
) -> tuple[Check, ...]:
    """Checks of the gate itself, once they pass or the time is up."""
    prepare_runtime(runtime, watching(config), goal)
    observer = Observer(timeout_s)
    parent = Parent(runtime, Programs(), observer)
    observer.end = lambda: parent.stop(signal.SIGTERM, None)
    supervise(parent)
    return observer.results(parent.loss)


def watching(config: ServiceConfig) -> ServiceConfig:
    """Settings with which nothing is sent to the vehicle, and nothing gives up early."""
    gate = dataclasses.replace(config.gate, engage=Engage.NEVER, exit_when_done=False)
    vehicle = dataclasses.replace(config.vehicle, timeout_s=_FOR_EVER_S)
    camera = dataclasses.replace(config.camera, timeout_s=_FOR_EVER_S)
    record = dataclasses.replace(config.record, folder="")
    return dataclasses.replace(config, gate=gate, vehicle=vehicle, camera=camera, record=record)


class Observer:
    """Display that keeps the newest list of checks, and ends the service when it has seen enough.

    Checks may fail for ``timeout_s`` until their crosses count; ``clock`` gives monotonic s.
    """

    def __init__(self, timeout_s: float, clock: Callable[[], float] = time.monotonic) -> None:
        self._clock = clock
        self._timeout_s = timeout_s
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

    def results(self, loss: str = "") -> tuple[Check, ...]:
        """Newest checks of the gate; one that fails, where it had no time to make any.

        ``loss`` says how a process crashed that had to run on, which is a check that fails.

        Raises
        ------
        DfvsError
            If a process could not run, or the check was interrupted.
        """
        if self.is_done and self.checks:
            return self.checks
        if loss:
            return (*self.checks, Check("service", False, loss, _CRASHED))
        errors = [line.removeprefix(_ERROR) for line in self.lines if line.startswith(_ERROR)]
        if errors:
            raise DfvsError(errors[-1])
        if not self.is_done:
            raise DfvsError("the check ended before the gate said anything")
        detail = f"not answered within {self._timeout_s:g} s"
        return (Check("gate", False, detail, "wait longer: --check-timeout SECONDS"),)

    def log(self, line: str) -> None:
        """Keep a line."""
        self.lines.append(line)

    def close(self) -> None:
        """Nothing to clean."""
