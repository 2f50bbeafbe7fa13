"""A ground-station link shared with further ground stations over a UDP port."""

import contextlib
import select
import socket
import threading
import time
from typing import Self

from pymavlink.dialects.v20 import development as mavlink

from dfvs_sim.ground.link import GroundLink, Message
from dfvs_sim.ground.udp import Endpoint

DEFAULT_PORT = 14551

_HOST = "127.0.0.1"
_SILENCE_NS = 5_000_000_000
"""A ground station that has sent nothing for so long has ended: heartbeats come once a second."""
_MESSAGES = tuple(kind.msgname for kind in mavlink.mavlink_map.values())


class LinkSharing:
    """Forwards the vehicle's messages to ground stations on this machine, and theirs to it.

    An autopilot answers one ground station on each of its UDP ports: the others join here, with
    ``udpout://127.0.0.1:PORT`` (0 for any). A ground station is known from its first message on.
    The link is shared and not owned.

    Raises
    ------
    ConfigError
        If the port is taken.
    """

    def __init__(self, link: GroundLink, port: int = DEFAULT_PORT) -> None:
        self._link = link
        self._socket = Endpoint(True, _HOST, port).open()
        self._socket.setblocking(False)
        self._wake, self._woken = socket.socketpair()
        self._lock = threading.Lock()
        self._received_ns: dict[tuple[str, int], int] = {}
        self._end = link.subscribe(_MESSAGES, self._to_stations)
        self._thread = threading.Thread(target=self._run, name="link-sharing", daemon=True)
        self._thread.start()

    def __enter__(self) -> Self:
        """Return the running forwarder."""
        return self

    def __exit__(self, *_: object) -> None:
        """Stop forwarding and give the port back."""
        self._end()
        self._wake.send(b"x")
        self._thread.join()
        with self._lock:  # the link's thread may be forwarding
            self._received_ns.clear()
            for sock in (self._socket, self._wake, self._woken):
                sock.close()

    @property
    def port(self) -> int:
        """UDP port that ground stations send to."""
        return int(self._socket.getsockname()[1])

    def _run(self) -> None:
        """Take what ground stations send, until closed."""
        while True:
            ready, _, _ = select.select([self._socket, self._woken], [], [])
            if self._woken in ready:
                return
            try:
                data, sender = self._socket.recvfrom(65535)
            except BlockingIOError:
                continue
            with self._lock:
                self._received_ns[sender] = time.monotonic_ns()
            self._link.send_bytes(data)

    def _to_stations(self, message: Message, t_ns: int) -> None:
        with self._lock:
            self._received_ns = {
                station: received_ns
                for station, received_ns in self._received_ns.items()
                if t_ns - received_ns < _SILENCE_NS
            }
            for station in self._received_ns:
                with contextlib.suppress(BlockingIOError):
                    self._socket.sendto(message.get_msgbuf(), station)
