"""Network ports for one flight.

MAVLink ports are any that are free: a PX4 that runs already sends to the usual ones. The others are
the usual ones where they are free.

Ports are chosen long before the service binds them. A lock keeps other flights from choosing the
same ones meanwhile: an abstract Unix socket, which ends with its process and leaves nothing behind.
"""

from __future__ import annotations

import socket
from dataclasses import dataclass, field

USUAL_ZENOH = 7447
USUAL_DASHBOARD = 8470
LOOPBACK = "127.0.0.1"

_ANY = 0
_TRIES = 20


@dataclass(frozen=True, slots=True)
class FlightPorts:
    """UDP ports of both MAVLink links, TCP ports of the others, all on this machine alone."""

    ground: int
    companion: int
    zenoh: int
    dashboard: int
    _locks: tuple[socket.socket, ...] = field(default=(), repr=False, compare=False)

    @property
    def zenoh_endpoint(self) -> str:
        """Where the service listens and the camera connects."""
        return f"tcp/{LOOPBACK}:{self.zenoh}"

    @classmethod
    def choose(cls) -> FlightPorts:
        """Ports that are free now and that no other flight has chosen.

        Raises
        ------
        OSError
            If there are none.
        """
        wanted = (
            (_ANY, socket.SOCK_DGRAM),
            (_ANY, socket.SOCK_DGRAM),
            (USUAL_ZENOH, socket.SOCK_STREAM),
            (USUAL_DASHBOARD, socket.SOCK_STREAM),
        )
        chosen = [_locked(preferred, kind) for preferred, kind in wanted]
        ground, companion, zenoh, dashboard = (port for port, _ in chosen)
        return cls(ground, companion, zenoh, dashboard, tuple(lock for _, lock in chosen))

    def close(self) -> None:
        """Let other flights choose these ports."""
        for lock in self._locks:
            lock.close()


def any_port(kind: socket.SocketKind) -> int:
    """Port that is free now, for datagrams or for a stream.

    Raises
    ------
    OSError
        If there is none.
    """
    port = _free(_ANY, kind)
    if port is None:
        raise OSError("no free port")
    return port


def _locked(preferred: int, kind: socket.SocketKind) -> tuple[int, socket.socket]:
    """Return the preferred port if it is free, else one that the system chooses, and its lock."""
    for wanted in (preferred, *[_ANY] * _TRIES):
        port = _free(wanted, kind)
        lock = None if port is None else _lock(port, kind)
        if port is not None and lock is not None:
            return port, lock
    raise OSError("no free port")


def _free(port: int, kind: socket.SocketKind) -> int | None:
    """Return the port if it can be bound now (0: any), else None."""
    with socket.socket(socket.AF_INET, kind) as probe:
        if kind is socket.SOCK_STREAM:
            probe.setsockopt(socket.SOL_SOCKET, socket.SO_REUSEADDR, 1)
        try:
            probe.bind((LOOPBACK, port))
        except OSError:
            return None
        return int(probe.getsockname()[1])


def _lock(port: int, kind: socket.SocketKind) -> socket.socket | None:
    """Lock of a port, None where another flight holds it."""
    lock = socket.socket(socket.AF_UNIX, socket.SOCK_DGRAM)
    try:
        lock.bind(f"\0dfvs-demo/{kind.name}/{port}")
    except OSError:
        lock.close()
        return None
    return lock
