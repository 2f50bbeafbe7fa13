"""Network ports for one flight: the usual ones where they are free, else any others."""

from __future__ import annotations

import socket
from dataclasses import dataclass

USUAL_GROUND = 14550
USUAL_COMPANION = 14540
USUAL_ZENOH = 7447
USUAL_DASHBOARD = 8470
LOOPBACK = "127.0.0.1"


@dataclass(frozen=True, slots=True)
class FlightPorts:
    """UDP ports of both MAVLink links, TCP ports of the others, all on this machine alone."""

    ground: int
    companion: int
    zenoh: int
    dashboard: int

    @property
    def zenoh_endpoint(self) -> str:
        """Where the service listens and the camera connects."""
        return f"tcp/{LOOPBACK}:{self.zenoh}"

    @classmethod
    def choose(cls) -> FlightPorts:
        """Ports that are free now."""
        return cls(
            ground=_free(USUAL_GROUND, socket.SOCK_DGRAM),
            companion=_free(USUAL_COMPANION, socket.SOCK_DGRAM),
            zenoh=_free(USUAL_ZENOH, socket.SOCK_STREAM),
            dashboard=_free(USUAL_DASHBOARD, socket.SOCK_STREAM),
        )


def any_port(kind: socket.SocketKind) -> int:
    """Port that is free now, for datagrams or for a stream."""
    return _free(0, kind)


def _free(preferred: int, kind: socket.SocketKind) -> int:
    """Return the preferred port if it can be bound, else one that the system chooses."""
    for port in (preferred, 0):
        with socket.socket(socket.AF_INET, kind) as probe:
            if kind is socket.SOCK_STREAM:
                probe.setsockopt(socket.SOL_SOCKET, socket.SO_REUSEADDR, 1)
            try:
                probe.bind((LOOPBACK, port))
            except OSError:
                continue
            return int(probe.getsockname()[1])
    raise OSError("no free port")
