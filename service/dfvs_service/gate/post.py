"""Datagrams of the gate: reports and commands from perception, statuses and heartbeats out."""

from __future__ import annotations

import contextlib
import socket
from collections.abc import Callable, Iterator
from pathlib import Path

from dfvs_core.errors import WireError
from dfvs_core.gate.authority import Authority
from dfvs_core.gate.events import BadReport, Event, Order, OtherServices, Report
from dfvs_core.wire.link import (
    ForwardedCommand,
    GateStatus,
    LeaseHolders,
    from_perception,
    to_datagram,
)
from dfvs_service.beat import Beat
from dfvs_service.runtime import RuntimeFolder

_MAX_TEXT = 200


class Post:
    """The gate's socket: turns what arrives into events, and never waits for a reader.

    Parameters
    ----------
    runtime : RuntimeFolder
        Where the sockets are.
    authority : Authority
        Judges the commands.
    note : callable
        Takes (kind, text) for the log.
    """

    def __init__(
        self, runtime: RuntimeFolder, authority: Authority, note: Callable[[str, str], None]
    ) -> None:
        self._runtime = runtime
        self._authority = authority
        self._note = note
        self._socket = socket.socket(socket.AF_UNIX, socket.SOCK_DGRAM)
        self._socket.bind(str(runtime.gate_socket))
        self._socket.setblocking(False)
        self.command_result = ""
        """What became of the last command."""
        self.command_count = 0
        self.has_seen_frame = False
        """Any report was about a frame."""

    def fileno(self) -> int:
        """Descriptor that is readable while datagrams wait."""
        return self._socket.fileno()

    def collect(self, clock: Callable[[], int]) -> Iterator[Event]:
        """Events of all datagrams that wait; ``clock`` gives the monotonic time in ns."""
        while True:
            try:
                data = self._socket.recv(65536)
            except BlockingIOError:
                return
            if (event := self._read(data, clock())) is not None:
                yield event

    def _read(self, data: bytes, now_ns: int) -> Event | None:
        try:
            message = from_perception(data)
        except WireError as error:
            return BadReport(now_ns, str(error)[:_MAX_TEXT])
        if isinstance(message, ForwardedCommand):
            return self._judge(message, now_ns)
        if isinstance(message, LeaseHolders):
            return OtherServices(now_ns, message.standing_by, message.engaged)
        self.has_seen_frame = self.has_seen_frame or message.t_capture_ns > 0
        return Report(now_ns, message)

    def _judge(self, command: ForwardedCommand, now_ns: int) -> Order | None:
        verdict = self._authority.judge(command.payload.encode(errors="replace"), now_ns)
        self.command_count += 1
        self.command_result = verdict.text[:_MAX_TEXT]
        self._note("command", self.command_result)
        action = verdict.action
        return None if action is None else Order(now_ns, action, verdict.argument)

    def answer(self, text: str) -> None:
        """Say what became of the last command, after the state machine heard of it."""
        self.command_result = text[:_MAX_TEXT]
        self._note("command", self.command_result)

    def send(self, status: GateStatus, beat: Beat) -> None:
        """Tell perception how the vehicle moves, and the parent that the loop turns."""
        self._send(to_datagram(status), self._runtime.perception_socket)
        self._send(beat.to_bytes(), self._runtime.parent_socket)

    def _send(self, data: bytes, address: Path) -> None:
        # A reader that is gone or slow is noticed by other means; the loop never waits for it.
        with contextlib.suppress(BlockingIOError, ConnectionRefusedError, FileNotFoundError):
            self._socket.sendto(data, str(address))
