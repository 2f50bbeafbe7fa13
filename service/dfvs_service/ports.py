"""Check that the service's local ports are free.

MAVSDK and Zenoh bind for themselves. MAVSDK shares a UDP port with whoever shares it too, and the
program that bound it last gets the autopilot's messages. Without this check a second service would
take the link away from one that flies.
"""

import contextlib
import errno
import json
import socket
from dataclasses import dataclass

from dfvs_core.errors import ConfigError
from dfvs_service.settings.endpoints import is_loopback
from dfvs_service.settings.mavlink_url import MavlinkUrl
from dfvs_service.settings.sections import ZenohSection

_ZENOH_KINDS = {
    "tcp": socket.SOCK_STREAM,
    "tls": socket.SOCK_STREAM,
    "ws": socket.SOCK_STREAM,
    "udp": socket.SOCK_DGRAM,
    "quic": socket.SOCK_DGRAM,
}
_MAVLINK_KINDS = {"udpin": socket.SOCK_DGRAM, "tcpin": socket.SOCK_STREAM}
_KIND_NAMES = {socket.SOCK_STREAM: "TCP", socket.SOCK_DGRAM: "UDP"}
_CONNECT_S = 0.2
_NEXT_PORTS = 100
"""So many ports after a taken one are tried before any other is proposed."""


@dataclass(frozen=True, slots=True)
class LocalPort:
    """Address on this machine at which a program listens."""

    kind: socket.SocketKind
    host: str
    port: int

    def is_in_use(self) -> bool:
        """Whether another program has the port; what else is wrong with it does not count."""
        with contextlib.suppress(socket.gaierror, UnicodeError):
            places = socket.getaddrinfo(self.host, self.port, type=self.kind)
            return any(_is_bound(family, kind, address) for family, kind, _, _, address in places)
        return False

    def is_unheard(self) -> bool:
        """Whether a connection on loopback is refused, since nobody listens; else unknown."""
        if self.kind != socket.SOCK_STREAM or not is_loopback(f"{self.host}:{self.port}"):
            return False
        try:
            socket.create_connection((self.host, self.port), _CONNECT_S).close()
        except ConnectionRefusedError:
            return True
        except OSError:
            return False
        return False

    def next_free(self) -> int:
        """Port of the same kind that is free at present: one of the next, or any."""
        for port in range(self.port + 1, min(self.port + _NEXT_PORTS, 65535) + 1):
            if not LocalPort(self.kind, self.host, port).is_in_use():
                return port
        with socket.socket(socket.AF_INET, self.kind) as probe:
            probe.bind(("", 0))
            return int(probe.getsockname()[1])

    def __str__(self) -> str:
        """Kind and number, such as ``TCP port 7447``."""
        return f"{_KIND_NAMES[self.kind]} port {self.port}"


def zenoh_port(endpoint: str) -> LocalPort | None:
    """Port of a Zenoh endpoint such as ``tcp/127.0.0.1:7447``, None where it has none."""
    protocol, _, rest = endpoint.partition("/")
    return _local_port(_ZENOH_KINDS.get(protocol), rest.split("#")[0].split("?")[0])


def mavlink_port(url: str) -> LocalPort | None:
    """Port at which MAVSDK listens for a connection's URL, None where it does not listen."""
    parts = MavlinkUrl.parse(url)
    host, kind = parts.host, _MAVLINK_KINDS.get(parts.scheme)
    if parts.scheme == "udp" and host in ("", "0.0.0.0"):
        host, kind = "0.0.0.0", socket.SOCK_DGRAM
    return None if kind is None else LocalPort(kind, host, parts.number)


def require_free_zenoh_ports(section: ZenohSection) -> None:
    """Refuse an endpoint to listen on that another program has.

    Raises
    ------
    ConfigError
        With the setting that would be right, a free port in it.
    """
    for endpoint in section.listen if section.mode == "peer" else ():
        port = zenoh_port(endpoint)
        if port is not None and port.is_in_use():
            free = _with_free_port(endpoint, port)
            listen = [free if each == endpoint else each for each in section.listen]
            raise ConfigError(
                f"{port} is taken by another program (maybe another dfvs-service)",
                remedy=f"end it, or choose a free port: --set 'zenoh.listen={json.dumps(listen)}', "
                "and let camera and dashboard connect there",
            )


def require_free_mavlink_port(url: str) -> None:
    """Refuse a MAVLink connection whose port another program has.

    Raises
    ------
    ConfigError
        With the connection that would be right, a free port in it.
    """
    port = mavlink_port(url)
    if port is not None and port.is_in_use():
        free = _with_free_port(url, port)
        raise ConfigError(
            f"{port} is taken by another program (maybe another dfvs-service)",
            remedy=f"end it, or let the autopilot send to a free port: --mavlink {free}",
        )


def _with_free_port(address: str, port: LocalPort) -> str:
    before, _, after = address.rpartition(f":{port.port}")
    return f"{before}:{port.next_free()}{after}"


def _local_port(kind: socket.SocketKind | None, address: str) -> LocalPort | None:
    host, _, number = address.rpartition(":")
    if kind is None or not number.isdecimal() or not 0 < int(number) <= 65535:
        return None
    return LocalPort(kind, host.strip("[]"), int(number))


def _is_bound(family: int, kind: int, address: tuple[object, ...]) -> bool:
    """Whether somebody has the address; a port that is merely being closed is free."""
    with socket.socket(family, kind) as probe:
        if kind == socket.SOCK_STREAM:
            probe.setsockopt(socket.SOL_SOCKET, socket.SO_REUSEADDR, 1)
        try:
            probe.bind(address)
        except OSError as error:
            return error.errno == errno.EADDRINUSE
        return False
