"""The ground station's UDP socket, from a connection URL."""

from __future__ import annotations

import re
import socket
from dataclasses import dataclass

from dfvs_core.errors import ConfigError

_OWN_PORT_ABOVE = 10_000
"""Of the remote port: PX4 answers the first port that it hears from until it is started anew."""

_URL = re.compile(r"(udpin|udpout):(?://)?([^:/]+):(\d{1,5})")


@dataclass(frozen=True, slots=True)
class Endpoint:
    """A parsed URL: listen there (``udpin``) or talk to there first (``udpout``)."""

    listens: bool
    host: str
    port: int

    @classmethod
    def from_url(cls, url: str) -> Endpoint:
        """Read ``udpin://HOST:PORT`` or ``udpout://HOST:PORT``.

        Raises
        ------
        ConfigError
            If the URL has another form.
        """
        match = _URL.fullmatch(url)
        if match is None or int(match[3]) > 65535:
            raise ConfigError(f"MAVLink URL {url!r}", "udpin://HOST:PORT or udpout://HOST:PORT")
        return cls(match[1] == "udpin", match[2], int(match[3]))

    def open(self) -> socket.socket:
        """Socket for this endpoint.

        That of ``udpout`` sends from the same port every time, where nobody else does.

        Raises
        ------
        ConfigError
            If the address cannot be used.
        """
        if not self.listens:
            self._find_host()
        sock = socket.socket(socket.AF_INET, socket.SOCK_DGRAM)
        if not self.listens:
            try:
                sock.bind(("", (self.port + _OWN_PORT_ABOVE) % 65536))
            except OSError:
                sock.bind(("", 0))
            return sock
        try:
            sock.bind((self.host, self.port))
        except OSError as error:
            sock.close()
            raise ConfigError(
                f"cannot listen on UDP {self.host}:{self.port} ({error.strerror})",
                "a free port",
                "is another ground station running on this machine?",
            ) from error
        return sock

    def _find_host(self) -> None:
        try:
            socket.getaddrinfo(self.host, self.port, socket.AF_INET, socket.SOCK_DGRAM)
        except (OSError, UnicodeError) as error:
            raise ConfigError(
                f"no host {self.host!r} is known ({error})", "the address of the vehicle's machine"
            ) from error
