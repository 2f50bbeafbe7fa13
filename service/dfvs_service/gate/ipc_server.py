"""IPC server of the gate: reports and commands in; states, answers and heartbeats out."""

import contextlib
import socket
from collections.abc import Callable, Iterator
from pathlib import Path

from dfvs_core.errors import WireError
from dfvs_core.gate.commands.authority import Authority
from dfvs_core.gate.events import BadReport, Event, OperatorCommand, OtherServices, Report
from dfvs_core.messages.link import (
    CommandAnswer,
    ForwardedCommand,
    GateStatus,
    LeaseHolders,
    ServiceFault,
    to_datagram,
    to_gate,
)
from dfvs_core.messages.schema import to_json
from dfvs_service.settings.runtime import RuntimeFolder
from dfvs_service.supervisor.heartbeat import Heartbeat

_MAX_TEXT = 200


class IpcServer:
    """The gate's socket: turns what arrives into events, and never waits for a reader.

    ``note`` takes (kind, text) for the log, ``on_fault`` one line about what failed outside the
    gate.
    """

    def __init__(
        self,
        runtime: RuntimeFolder,
        authority: Authority,
        note: Callable[[str, str], None],
        on_fault: Callable[[str], None],
    ) -> None:
        self._runtime = runtime
        self._authority = authority
        self._note = note
        self._on_fault = on_fault
        self._accepted = ""
        """Request id of a command whose answer waits until the state machine has taken it."""
        self._socket = socket.socket(socket.AF_UNIX, socket.SOCK_DGRAM)
        self._socket.bind(str(runtime.gate_socket))
        self._socket.setblocking(False)
        self.command_result = ""
        """What became of the last command."""
        self.command_count = 0
        self.first_report_ns: int | None = None
        """When perception reported for the first time, monotonic."""
        self.has_seen_frame = False
        """Any report was about a frame."""

    def fileno(self) -> int:
        """Descriptor that is readable while datagrams wait."""
        return self._socket.fileno()

    def collect(self, clock: Callable[[], int]) -> Iterator[Event]:
        """Events of the datagrams that wait; ``clock`` gives the monotonic time in ns.

        An accepted command is the last event: a step takes one, and refuses one.
        """
        while not self._accepted:
            try:
                data = self._socket.recv(65536)
            except BlockingIOError:
                return
            if (event := self._read(data, clock())) is not None:
                yield event

    def _read(self, data: bytes, now_ns: int) -> Event | None:
        try:
            message = to_gate(data)
        except WireError as error:
            return BadReport(now_ns, str(error)[:_MAX_TEXT])
        if isinstance(message, ForwardedCommand):
            return self._judge(message, now_ns)
        if isinstance(message, LeaseHolders):
            return OtherServices(now_ns, message.standing_by, message.engaged)
        if isinstance(message, ServiceFault):
            self._on_fault(message.service_fault[:_MAX_TEXT])
            return None
        if self.first_report_ns is None:
            self.first_report_ns = now_ns
        self.has_seen_frame = self.has_seen_frame or message.t_capture_ns > 0
        return Report(now_ns, message)

    def _judge(self, command: ForwardedCommand, now_ns: int) -> OperatorCommand | None:
        answer = self._authority.evaluate(command.payload.encode(errors="replace"), now_ns)
        if answer.action is not None:
            self._accepted = answer.request
            self._set_result(answer.text)
            return OperatorCommand(now_ns, answer.action, answer.argument)
        if answer.is_repeated:
            self._note("command", f"repeated: {answer.text}")
        else:
            self._set_result(answer.text)
        self._answer(answer.request, answer.text)
        return None

    def answer_accepted(self, refusal: str) -> None:
        """Answer the command that the state machine has taken in this step.

        ``refusal`` says why the state forbids it, empty where it is obeyed.
        """
        if not self._accepted:
            return
        if refusal:
            self.command_result = refusal[:_MAX_TEXT]
            self._note("command", self.command_result)
            self._authority.record(self._accepted, self.command_result)
        self._answer(self._accepted, self.command_result)
        self._accepted = ""

    def _set_result(self, text: str) -> None:
        self.command_count += 1
        self.command_result = text[:_MAX_TEXT]
        self._note("command", self.command_result)

    def _answer(self, request: str, text: str) -> None:
        self._send(to_datagram(CommandAnswer(request, text[:_MAX_TEXT])), self._runtime.link_socket)

    def send(self, status: GateStatus, heartbeat: Heartbeat) -> None:
        """Send the state to perception and the operator link, and a heartbeat to the parent."""
        data = to_datagram(status)
        self._send(data, self._runtime.perception_socket)
        self._send(data, self._runtime.link_socket)
        self._send(to_json(heartbeat), self._runtime.parent_socket)

    def _send(self, data: bytes, address: Path) -> None:
        # A reader that is gone or slow is noticed by other means; the loop never waits for it.
        with contextlib.suppress(BlockingIOError, ConnectionRefusedError, FileNotFoundError):
            self._socket.sendto(data, str(address))
