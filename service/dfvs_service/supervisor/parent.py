"""Parent process: starts the service's processes, supervises the gate, restarts nothing.

A gate that misses its heartbeat is killed; the autopilot's own failsafe then takes over. A
perception or an operator link that dies is noticed by the gate, which goes to zero and gives the
vehicle back.
Nothing that died is ever started again into motion.
"""

import contextlib
import os
import shutil
import socket
import sys
import time
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from types import FrameType

from dfvs_common.lifecycle import EXIT_CANNOT_RUN, EXIT_FAILED, handle_ending_signals
from dfvs_core.errors import WireError
from dfvs_core.gate.config import MS
from dfvs_core.gate.states import ENGAGED, GateState
from dfvs_core.messages.goal import Goal
from dfvs_core.messages.image import encode_png
from dfvs_core.messages.link import ServiceFault, to_datagram
from dfvs_core.messages.schema import from_json
from dfvs_service.settings.config import ServiceConfig
from dfvs_service.settings.runtime import RuntimeFolder
from dfvs_service.supervisor.child import LEAST_END_S, Child
from dfvs_service.supervisor.child_process import prefer_this_process
from dfvs_service.supervisor.console import ConsoleWriter, Display
from dfvs_service.supervisor.heartbeat import HangDetector, Heartbeat
from dfvs_service.supervisor.journal import Journal
from dfvs_service.supervisor.refusals import StandingRefusals
from dfvs_service.supervisor.systemd_notify import Notifier

_POLL_S = 0.02
_PING_NS = 100 * MS
_SHOW_NS = 200 * MS
_STOP_LIMIT_S = 1.6
_END_LIMIT_S = 1.95
"""From the request to stop until nothing runs any more; the gate's own time comes first."""
_QUIET_END_S = 0.8
_CONSOLE_END_S = 0.3
_NOTABLE = ("error: ", "warning: ")
_MAX_FAULT = 200
_LOSSES = {"recorder": "nothing more is recorded", "black box": "no more of this flight is kept"}


@dataclass(frozen=True, slots=True)
class Programs:
    """Commands that start the processes; ``--runtime DIR`` is added. Empty ones are not started."""

    gate: Sequence[str] = (sys.executable, "-m", "dfvs_service.gate")
    perception: Sequence[str] = (sys.executable, "-m", "dfvs_service.perception")
    recorder: Sequence[str] = ()
    link: Sequence[str] = (sys.executable, "-m", "dfvs_service.operator_link")
    black_box: Sequence[str] = ()


def prepare_runtime(
    runtime: RuntimeFolder, config: ServiceConfig, goal: Goal, later: Sequence[Goal] = ()
) -> None:
    """Put the resolved settings, the goal and those after it where the processes look for them.

    What an earlier service left in the folder goes.
    """
    runtime.config.write_text(config.to_json(), encoding="utf-8")
    for old in runtime.later_goals():
        old.unlink()
    shutil.rmtree(runtime.new_goals, ignore_errors=True)
    _put_goal(runtime.goal_image, goal)
    for number, following in enumerate(later, start=1):
        _put_goal(runtime.later_goal(number), following)
    inner = (runtime.gate_socket, runtime.perception_socket, runtime.link_socket)
    outer = (runtime.parent_socket, runtime.zenoh_socket, runtime.black_box_socket)
    logs = (runtime.gate_log, runtime.gate_inputs, runtime.service_log)
    for path in (*inner, *outer, *logs, *runtime.stderr_files()):
        path.unlink(missing_ok=True)


def _put_goal(image_path: Path, goal: Goal) -> None:
    image_path.write_bytes(encode_png(goal.image))
    image_path.with_suffix(".json").write_text(goal.sidecar.to_json(), encoding="utf-8")


class Parent:
    """Starts the processes in a prepared runtime folder, and watches over them."""

    def __init__(self, runtime: RuntimeFolder, programs: Programs, display: Display) -> None:
        self._console = ConsoleWriter(display)
        self._log = Journal(runtime.service_log, self._console.log)
        self._gate_address = str(runtime.gate_socket)
        self._socket = socket.socket(socket.AF_UNIX, socket.SOCK_DGRAM)
        self._socket.bind(str(runtime.parent_socket))
        self._socket.settimeout(_POLL_S)
        options = ("--runtime", str(runtime.path))
        self._gate = Child((*programs.gate, *options), runtime.stderr("gate"))
        self._perception = Child((*programs.perception, *options), runtime.stderr("perception"))
        self._link = Child((*programs.link, *options), runtime.stderr("operator_link"))
        self._children = {"gate": self._gate, "perception": self._perception}
        if programs.recorder:
            recorder = Child((*programs.recorder, *options), runtime.stderr("recorder"))
            self._children["recorder"] = recorder
        self._children["operator link"] = self._link  # late: others send through it
        if programs.black_box:
            black_box = Child((*programs.black_box, *options), runtime.stderr("black-box"))
            self._children["black box"] = black_box
        prefer_this_process()  # after the start of the children, which would inherit it
        self._notifier = Notifier(os.environ)
        self._hang_detector = HangDetector(time.monotonic_ns())
        self._heartbeat = Heartbeat(0, str(GateState.IDLE), "starting")
        self._refusals = StandingRefusals()
        self._reported: set[str] = set()
        self._next_ping_ns = self._next_show_ns = 0
        self._stop_requested = False
        self._stop_by_s: float | None = None
        self.loss = ""
        """How a process that had to run on ended, in words; empty where none did."""
        self.is_all_shown = True
        """Whether all lines have reached the terminal, once ``run`` has ended."""
        self._code: int | None = None

    def stop(self, _signal: int, _frame: FrameType | None) -> None:
        """Signal handler: end the flight in an orderly way."""
        self._stop_requested = True
        if self._stop_by_s is None:
            self._stop_by_s = time.monotonic() + _END_LIMIT_S

    def run(self) -> int:
        """Watch until the gate has ended; returns the service's exit code."""
        self._notifier.ready()
        try:
            while self._gate.code is None:
                self._step()
        finally:
            self._notifier.stopping()
            self._end_all()
            self._notifier.close()
        return self._exit_code

    @property
    def _exit_code(self) -> int:
        """The service's exit code, once the gate has ended."""
        if self._code is not None:
            return self._code
        code = self._gate.code
        return code if code is not None and 0 <= code <= EXIT_CANNOT_RUN else EXIT_FAILED

    def _report_end(self) -> None:
        """Say that the gate did not end by itself."""
        code = self._gate.code
        if code is not None and self._code is None and not self._stop_requested:
            ending = self._lose("the gate", self._gate)
            if code < 0:
                self._report(f"error: {ending}; the autopilot's failsafe has the vehicle")

    def _lose(self, name: str, child: Child) -> str:
        """How a process ended, in words; kept, unless it has said by an error why it cannot run."""
        ending = f"{name} {child.ending}"
        if child.code != EXIT_CANNOT_RUN:
            self.loss = ending
        return ending

    def _step(self) -> None:
        self._listen()
        now_ns = time.monotonic_ns()
        if self._hang_detector.is_overdue(now_ns):
            self._gate.kill()
            self._code = EXIT_FAILED
            self._report(
                "error: the gate hung and was killed; the autopilot's failsafe has the vehicle"
            )
            return
        if now_ns >= self._next_ping_ns:
            self._next_ping_ns = now_ns + _PING_NS
            self._notifier.alive()
            for child in self._children.values():
                child.ping()
        if now_ns >= self._next_show_ns:
            self._next_show_ns = now_ns + _SHOW_NS
            self._console.show(self._heartbeat)
            if line := self._refusals.update(self._heartbeat):
                self._tell(line)
            self._pass_on_errors()
            self._check_needed("perception", self._perception)
            self._check_needed("the operator link", self._link)
            self._check_recorders()
        if self._stop_requested:
            self._stop_gate()

    def _listen(self) -> None:
        """Take the gate's heartbeats; return at the latest after one look's time."""
        with contextlib.suppress(TimeoutError):
            data = self._socket.recv(65536)
            self._hang_detector.on_heartbeat(time.monotonic_ns())
            with contextlib.suppress(WireError):
                self._heartbeat = from_json(Heartbeat, data)

    def _check_needed(self, name: str, child: Child) -> None:
        """End a service that lacks a process, once nothing is flown any more."""
        code = child.code
        if code is None:
            return
        self._report(f"warning: {self._lose(name, child)}")
        if self._heartbeat.state not in ENGAGED:
            self._code = EXIT_CANNOT_RUN if code == EXIT_CANNOT_RUN else EXIT_FAILED
            self._stop_requested = True

    def _check_recorders(self) -> None:
        """Say that recorder or black box are gone; the flight goes on without."""
        for name, loss in _LOSSES.items():
            child = self._children.get(name)
            if child is not None and child.code is not None:
                self._report_recorder(f"warning: the {name} {child.ending}; {loss}")

    def _report_recorder(self, line: str) -> None:
        """Say a warning of recorder or black box, and have the gate show it to operators."""
        if line not in self._reported:
            text = line.partition(": ")[2][:_MAX_FAULT]
            with contextlib.suppress(OSError):  # a gate that is gone shows nothing
                datagram = to_datagram(ServiceFault(text))
                self._socket.sendto(datagram, self._gate_address)
        self._report(line)

    def _stop_gate(self) -> None:
        """Let the gate bring the vehicle to Hold; kill it if that takes too long."""
        self._gate.terminate()
        # Perception has nothing to bring to an end, and the gate no more use for it. The operator
        # link goes on telling the state until the gate has ended.
        self._perception.terminate()
        deadline = time.monotonic() + _STOP_LIMIT_S
        while self._gate.code is None and time.monotonic() < deadline:
            self._listen()
            self._gate.ping()
        if self._gate.code is None:
            self._gate.kill()
            self._code = EXIT_FAILED
            self._report("error: the gate did not end in time and was killed")

    def _end_all(self) -> None:
        """Leave no process behind, and no error unsaid."""
        now_s = time.monotonic()
        until_s = now_s + _QUIET_END_S if self._stop_by_s is None else self._stop_by_s
        # Recorder and operator link late, the black box last: others send to them until their end.
        black_box = self._children.get("black box")
        for child in self._children.values():
            if child is not black_box:
                child.end_by(until_s)
        self._console.show(self._heartbeat)
        self._pass_on_errors()
        self._report_end()
        self._log.add(time.monotonic_ns(), "end", code=self._exit_code)
        self._log.close(LEAST_END_S)
        if black_box is not None:
            black_box.end_by(until_s)
            self._pass_on_errors()
        self.is_all_shown = self._console.close(_CONSOLE_END_S)
        self._socket.close()

    def _pass_on_errors(self) -> None:
        """Show the children's errors and warnings, and the gate's advice, once each."""
        for line in self._heartbeat.warnings:
            self._report(f"warning: {line}")
        for name, child in self._children.items():
            report = self._report_recorder if name in _LOSSES else self._report
            for line in child.new_errors():
                if line.startswith(_NOTABLE):
                    report(line)

    def _report(self, line: str) -> None:
        if line not in self._reported:
            self._reported.add(line)
            self._tell(line)

    def _tell(self, line: str) -> None:
        self._log.add(time.monotonic_ns(), "told", text=line)
        self._console.log(line)


def fly(runtime: RuntimeFolder, programs: Programs, display: Display) -> int:
    """Run the service in a prepared runtime folder until it ends; returns its exit code."""
    return supervise(Parent(runtime, programs, display))


def supervise(parent: Parent) -> int:
    """Run a parent that ends in an orderly way when it is told to; returns its exit code."""
    handle_ending_signals(parent.stop)
    code = parent.run()
    if not parent.is_all_shown:
        os._exit(code)  # the interpreter's end would wait for a terminal that takes nothing
    return code
