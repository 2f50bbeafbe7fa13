"""Client of the gate's IPC server."""

import logging
import socket
import threading
from collections.abc import Callable
from pathlib import Path

from dfvs_core.errors import WireError
from dfvs_core.messages.link import FromGate, ServiceFault, ToGate, from_gate, to_datagram
from dfvs_service.supervisor.watched_thread import start_watched

_POLL_S = 0.2

log = logging.getLogger("dfvs.gate_link")


class GateLink:
    """Sends at once, and calls back for everything that the gate sends.

    The kernel queues ten datagrams and drops the newest, so a thread of its own takes them in
    while the process is busy.

    ``gate`` and ``own`` are the sockets of the gate and of this process. ``on_message`` takes the
    gate's messages, on that thread, and must not block.
    """

    def __init__(self, gate: Path, own: Path, on_message: Callable[[FromGate], None]) -> None:
        self._gate_address = str(gate)
        self._on_message = on_message
        self._socket = socket.socket(socket.AF_UNIX, socket.SOCK_DGRAM)
        self._socket.bind(str(own))
        self._socket.settimeout(_POLL_S)
        self._sender = socket.socket(socket.AF_UNIX, socket.SOCK_DGRAM)
        self._sender.setblocking(False)
        self._closed = threading.Event()
        self._thread = start_watched("gate-link", self._listen, self.report)

    def send(self, message: ToGate) -> None:
        """Send to the gate; one that is gone or slow is the gate's and the parent's matter."""
        try:
            self._sender.sendto(to_datagram(message), self._gate_address)
        except (BlockingIOError, ConnectionRefusedError, FileNotFoundError) as error:
            log.debug("message not delivered: %s", error)

    def report(self, line: str) -> None:
        """Have the gate show the failure of a thread of this process."""
        self.send(ServiceFault(line))

    def close(self) -> None:
        """Stop listening."""
        self._closed.set()
        self._thread.join(2 * _POLL_S)
        self._socket.close()
        self._sender.close()

    def _listen(self) -> None:
        while not self._closed.is_set():
            try:
                message = from_gate(self._socket.recv(65536))
            except TimeoutError:
                continue
            except WireError as error:
                log.warning("datagram from the gate dropped: %s", error)
                continue
            self._on_message(message)
