"""Non-blocking datagrams of telemetry for the black box."""

import errno
import socket
from pathlib import Path

from dfvs_common.progress import warn

_SEND_BUFFER_BYTES = 212_992
"""Linux's default limit; the kernel doubles it, and a datagram must fit into it."""
_OVERHEAD_BYTES = 64
"""What the kernel needs of it for itself, and the name of the stream."""


class FlightFeed:
    """Sends records to the black box of the same service; never blocks, never raises.

    ``address`` is the black box's socket, which need not exist.
    """

    def __init__(self, address: Path) -> None:
        self._address = str(address)
        self._socket = socket.socket(socket.AF_UNIX, socket.SOCK_DGRAM)
        self._socket.setblocking(False)
        self._socket.setsockopt(socket.SOL_SOCKET, socket.SO_SNDBUF, _SEND_BUFFER_BYTES)
        buffer_bytes = self._socket.getsockopt(socket.SOL_SOCKET, socket.SO_SNDBUF)
        self.max_bytes = buffer_bytes - _OVERHEAD_BYTES
        """Largest payload that fits."""
        self._too_large: set[str] = set()

    def put(self, stream: str, payload: bytes) -> bool:
        """Send one record of a stream, from one thread; returns whether that is settled.

        It is not where the black box does not take the record now. One that is too large is
        dropped for good, and the first one of a stream is said.
        """
        try:
            self._socket.sendto(stream.encode() + b"\n" + payload, self._address)
        except OSError as error:
            if error.errno != errno.EMSGSIZE:
                return False
            self._report_too_large(stream, len(payload))
        return True

    def close(self) -> None:
        """Send nothing more."""
        self._socket.close()

    def _report_too_large(self, stream: str, size_bytes: int) -> None:
        if stream not in self._too_large:
            self._too_large.add(stream)
            size = f"{size_bytes} bytes, {self.max_bytes} fit"
            warn(f"the black box lacks a record of {stream!r}: it is too large ({size})")


def split_record(datagram: bytes) -> tuple[str, bytes]:
    """Stream and payload of a datagram; an empty stream where it is none of ours."""
    name, _, payload = datagram.partition(b"\n")
    return name.decode(errors="replace"), payload
