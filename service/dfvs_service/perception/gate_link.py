"""The datagrams between perception and the gate, on perception's side."""

from __future__ import annotations

import logging
import socket
import threading
from collections import deque

from dfvs_core.errors import WireError
from dfvs_core.wire.link import (
    FromPerception,
    GateStatus,
    from_datagram,
    to_datagram,
)
from dfvs_service.runtime import RuntimeFolder

_POLL_S = 0.2
_KEPT = 256

log = logging.getLogger("dfvs.perception.gate")


class GateLink:
    """Sends reports at once, and keeps what the gate says until it is asked for.

    The kernel queues ten datagrams and drops the newest, so a thread of its own takes them in
    while a picture is being matched.
    """

    def __init__(self, runtime: RuntimeFolder) -> None:
        self._gate_address = str(runtime.gate_socket)
        self._socket = socket.socket(socket.AF_UNIX, socket.SOCK_DGRAM)
        self._socket.bind(str(runtime.perception_socket))
        self._socket.settimeout(_POLL_S)
        self._sender = socket.socket(socket.AF_UNIX, socket.SOCK_DGRAM)
        self._sender.setblocking(False)
        self._heard: deque[GateStatus] = deque(maxlen=_KEPT)
        self._closed = threading.Event()
        self._thread = threading.Thread(target=self._listen, name="gate-link", daemon=True)
        self._thread.start()

    def send(self, message: FromPerception) -> None:
        """Send to the gate; one that is gone or slow is the gate's and the parent's matter."""
        try:
            self._sender.sendto(to_datagram(message), self._gate_address)
        except (BlockingIOError, ConnectionRefusedError, FileNotFoundError) as error:
            log.debug("message not delivered: %s", error)

    def heard(self) -> list[GateStatus]:
        """Everything the gate said since the last call, oldest first."""
        statuses = []
        while self._heard:
            statuses.append(self._heard.popleft())
        return statuses

    def close(self) -> None:
        """Stop listening."""
        self._closed.set()
        self._thread.join(2 * _POLL_S)
        self._socket.close()
        self._sender.close()

    def _listen(self) -> None:
        while not self._closed.is_set():
            try:
                self._heard.append(from_datagram(GateStatus, self._socket.recv(65536)))
            except TimeoutError:
                continue
            except WireError as error:
                log.warning("datagram from the gate dropped: %s", error)
