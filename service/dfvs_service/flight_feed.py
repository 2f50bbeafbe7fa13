"""Non-blocking datagrams of telemetry for the black box."""

import socket
from pathlib import Path

_SEND_BUFFER_BYTES = 212_992
"""Linux's default limit; the kernel doubles it, and a datagram must fit into it."""


class FlightFeed:
    """Sends records to the black box of the same service; never blocks, never raises.

    Parameters
    ----------
    address : Path
        Socket of the black box; need not exist.
    """

    def __init__(self, address: Path) -> None:
        self._address = str(address)
        self._socket = socket.socket(socket.AF_UNIX, socket.SOCK_DGRAM)
        self._socket.setblocking(False)
        self._socket.setsockopt(socket.SOL_SOCKET, socket.SO_SNDBUF, _SEND_BUFFER_BYTES)

    def put(self, stream: str, payload: bytes) -> bool:
        """Send one record of a stream, from one thread; returns whether it was taken."""
        try:
            self._socket.sendto(stream.encode() + b"\n" + payload, self._address)
        except OSError:
            return False
        return True

    def close(self) -> None:
        """Send nothing more."""
        self._socket.close()


def split_record(datagram: bytes) -> tuple[str, bytes]:
    """Stream and payload of a datagram; an empty stream where it is none of ours."""
    name, _, payload = datagram.partition(b"\n")
    return name.decode(errors="replace"), payload
