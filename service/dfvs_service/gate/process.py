"""Gate process: one loop between perception, autopilot, operator link and parent.

The loop wakes at 50 Hz and whenever something arrives, steps the state machine, and sends what
it says. Nothing in the loop waits for anything else.
"""

import secrets
import selectors
import signal
import threading
import time
from collections.abc import Callable
from types import FrameType
from typing import Protocol

from dfvs_common.lifecycle import EXIT_FAILED, EXIT_OK
from dfvs_common.progress import log
from dfvs_core.errors import DfvsError
from dfvs_core.gate.commands.authority import Authority
from dfvs_core.gate.config import MS, S
from dfvs_core.gate.events import (
    AmbiguousLink,
    Event,
    GateOutput,
    ModeRequest,
    MonitorFailed,
    ParametersRead,
    Stop,
    VehicleEvent,
)
from dfvs_core.gate.limits import BodyVelocity
from dfvs_core.gate.machine import GateMachine
from dfvs_core.gate.states import GateState
from dfvs_service.gate.event_queue import EventQueue
from dfvs_service.gate.input_journal import InputJournal
from dfvs_service.gate.ipc_server import IpcServer
from dfvs_service.gate.parent_watchdog import ParentWatchdog
from dfvs_service.gate.startup import startup_problem
from dfvs_service.gate.status import gate_status
from dfvs_service.settings.config import ServiceConfig
from dfvs_service.settings.runtime import RuntimeFolder
from dfvs_service.supervisor.heartbeat import Heartbeat
from dfvs_service.supervisor.journal import Journal
from dfvs_service.supervisor.watched_thread import run_watched

TICK_NS = 20 * MS
_FLUSH_S = 0.1
"""For each of both journals: the parent takes 300 ms without a heartbeat for a hang."""

_CHECKED = frozenset({GateState.IDLE, GateState.PREFLIGHT, GateState.READY})

_MAX_FAULTS = 3


class AutopilotLink(Protocol):
    """What the loop needs of the autopilot; neither call may block."""

    def send_velocity(self, velocity: BodyVelocity) -> None:
        """Send one setpoint."""

    def request_mode(self, request: ModeRequest) -> None:
        """Ask for a mode once."""


class SilentLink:
    """A link that sends nothing, for a gate that shall only watch."""

    def __init__(self, note: Callable[[str, str], None]) -> None:
        self._note = note

    def send_velocity(self, velocity: BodyVelocity) -> None:
        """Send no setpoint."""
        self._note("not_sent", f"setpoint {velocity}")

    def request_mode(self, request: ModeRequest) -> None:
        """Ask for no mode."""
        self._note("not_sent", f"request for {request}")


class GateProcess:
    """Loop of the gate process.

    ``key`` is the secret of signed commands, ``parent`` the descriptor of the pipe on which the
    parent shows that it lives.
    """

    def __init__(
        self, config: ServiceConfig, runtime: RuntimeFolder, key: bytes | None, parent: int
    ) -> None:
        now_ns = time.monotonic_ns()
        self._config = config
        self._event_queue = EventQueue()
        self._journal = Journal(runtime.gate_log, log)
        self._machine = GateMachine(config.gate_config(), now_ns)
        self._faults: tuple[str, ...] = ()
        """What failed that the flight can do without, one line each."""
        self._inputs = InputJournal(runtime.gate_inputs, config.gate_config(), now_ns, self.report)
        name = config.vehicle.name
        self._authority = Authority(key, name, lambda: secrets.token_hex(16), now_ns)
        self._ipc = IpcServer(runtime, self._authority, self.note, self.report)
        self._parent_watchdog = ParentWatchdog(parent, now_ns)
        self._warnings: tuple[str, ...] = ()
        self._fatal: DfvsError | None = None
        self._device_loss: DfvsError | None = None
        self._stopping = False
        self._selector = selectors.DefaultSelector()
        for source in (self._event_queue, self._ipc, self._parent_watchdog):
            self._selector.register(source, selectors.EVENT_READ)

    # --- other threads and signals --------------------------------------------------------

    def emit(self, event: VehicleEvent) -> None:
        """Take an event of the vehicle, from any thread."""
        self._event_queue.put(event)

    def note(self, kind: str, text: str) -> None:
        """Log a line, from any thread."""
        self._journal.add(time.monotonic_ns(), kind, text=text)

    def report(self, line: str) -> None:
        """Show and log a failure that the flight can do without, from any thread."""
        self.note("fault", line)
        if line not in self._faults:
            self._faults = (line, *self._faults)[:_MAX_FAULTS]

    def fail(self, error: DfvsError) -> None:
        """End because the vehicle cannot be reached, from any thread."""
        self._fatal = error

    def on_device_lost(self, error: DfvsError) -> None:
        """End because the autopilot's device is gone, after a flight's own end; any thread."""
        self.note("device_lost", str(error))
        self._device_loss = error

    def on_monitor_failed(self, line: str) -> None:
        """Take the end of the watch over parameters and other commanders, from any thread."""
        self._event_queue.put(MonitorFailed(time.monotonic_ns(), line))

    def stop(self, signal_number: int, _frame: FrameType | None) -> None:
        """Signal handler: bring the vehicle to Hold, then end."""
        name = signal.Signals(signal_number).name
        self._stopping = True
        self._event_queue.put(Stop(time.monotonic_ns(), f"by {name}"))

    # --- loop -----------------------------------------------------------------------------

    def run(self, link: AutopilotLink) -> int:
        """Run until the flight is over or the service is told to end; returns the exit code."""
        next_tick = time.monotonic_ns()
        while True:
            wait_s = max(next_tick - time.monotonic_ns(), 0) / S
            events = self._collect(wait_s)
            now_ns = time.monotonic_ns()
            output = self._machine.step(now_ns, events)
            self._apply(output, link, now_ns)
            self._inputs.add(now_ns, events, output, is_flight=self._is_flight)
            if now_ns >= next_tick:
                next_tick = max(next_tick + TICK_NS, now_ns - TICK_NS)
                self._publish(now_ns)
            code = self._ending(now_ns)
            if code is not None:
                self._journal.add(now_ns, "end", code=code, state=str(self._machine.state))
                self._publish(now_ns)
                return code

    def close(self) -> None:
        """Flush the log and the journal."""
        self._journal.close(_FLUSH_S)
        self._inputs.close(_FLUSH_S)

    @property
    def _is_flight(self) -> bool:
        """Whether the gate is engaged, or still ends an engagement."""
        return self._machine.state not in _CHECKED and not self._machine.is_finished

    def _collect(self, wait_s: float) -> list[Event]:
        """Wait for something to arrive; return all that has, as events."""
        self._selector.select(wait_s)
        events = [*self._event_queue.drain(), *self._ipc.collect(time.monotonic_ns)]
        if (stop := self._parent_watchdog.poll(time.monotonic_ns())) is not None:
            self._stopping = True
            self._selector.unregister(self._parent_watchdog)
            events.append(stop)
        for event in events:
            if isinstance(event, ParametersRead):
                self._warn(event)
            elif isinstance(event, AmbiguousLink):
                self.report(event.detail)
        return events

    def _warn(self, event: ParametersRead) -> None:
        previous, self._warnings = self._warnings, (*event.refusals, *event.advice)
        for line in self._warnings:
            if line not in previous:
                self._journal.add(event.t_ns, "warning", text=line)

    def _apply(self, output: GateOutput, link: AutopilotLink, now_ns: int) -> None:
        """Send first, log afterwards."""
        if output.setpoint is not None:
            link.send_velocity(output.setpoint)
        if output.mode_request is not None:
            link.request_mode(output.mode_request)
            self._journal.add(now_ns, "mode_request", mode=str(output.mode_request))
        self._ipc.answer_accepted(output.refusal)
        for change in output.transitions:
            self._journal.add(
                change.t_ns,
                "transition",
                source=str(change.source),
                target=str(change.target),
                cause=str(change.cause),
                detail=change.detail,
            )

    def _publish(self, now_ns: int) -> None:
        """Send the state to perception and the operator link, and a heartbeat to the parent."""
        ipc = self._ipc
        status = gate_status(
            self._machine,
            now_ns,
            challenge=self._authority.challenge(now_ns),
            command=(ipc.command_result, ipc.command_count),
            warnings=(*self._faults, *self._warnings),
        )
        good = self._machine.perception.good
        heartbeat = Heartbeat(
            now_ns,
            status.state,
            status.cause,
            None if good is None else good.error_m,
            None if good is None else good.error_rad,
            status.reached,
            status.warnings,
            self._machine.checks() if self._machine.state in _CHECKED else (),
        )
        ipc.send(status, heartbeat)

    # --- the end --------------------------------------------------------------------------

    def _ending(self, now_ns: int) -> int | None:
        """Exit code if it is time to end."""
        machine = self._machine
        if self._fatal is not None:
            raise self._fatal
        if (problem := self._startup_problem(now_ns)) is not None:
            raise problem
        if self._stopping and machine.is_finished:
            return EXIT_OK if machine.has_reached else EXIT_FAILED
        if self._config.gate.exit_when_done and machine.is_finished:
            return EXIT_OK if machine.has_reached else EXIT_FAILED
        if self._device_loss is not None and not self._is_flight:
            raise self._device_loss
        return None

    def _startup_problem(self, now_ns: int) -> DfvsError | None:
        """Say that perception never reported, or no frame ever came, in time enough for it."""
        machine, ipc = self._machine, self._ipc
        if ipc.has_seen_frame or machine.state is not GateState.PREFLIGHT:
            return None
        first_ns, timeout_s = ipc.first_report_ns, self._config.camera.timeout_s
        reported_ns = None if first_ns is None else now_ns - first_ns
        waited_ns = now_ns - machine.since_ns
        return startup_problem(waited_ns, reported_ns, timeout_s, machine.perception.reason)


def start_autopilot(
    connect: Callable[[], None], watch: Callable[[], None], gate: GateProcess
) -> threading.Thread:
    """Connect, and watch what changes slowly, on a thread: both block.

    A watch that ends is reported, and keeps the gate from flying.
    """

    def work() -> None:
        try:
            connect()
        except DfvsError as error:
            gate.fail(error)
            return
        run_watched("autopilot-watch", watch, gate.report, gate.on_monitor_failed)

    thread = threading.Thread(target=work, name="autopilot-watch", daemon=True)
    thread.start()
    return thread
