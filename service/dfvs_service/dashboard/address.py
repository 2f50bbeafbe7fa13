"""Addresses of the dashboard's page, and the origins that they allow."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass

LOOPBACK_NAMES = ("127.0.0.1", "localhost", "[::1]")
"""Names that always mean this machine."""

_DEFAULT_PORTS = {"http": 80, "https": 443}


@dataclass(frozen=True, slots=True)
class PublicAddress:
    """Scheme and ``host:port`` spellings under which the page may be reached."""

    scheme: str
    hosts: frozenset[str]

    @classmethod
    def of(cls, names: Iterable[str], port: int, *, secure: bool) -> PublicAddress:
        """Names (``[...]`` around IPv6) on a port; the scheme's usual port may be left out."""
        scheme = "https" if secure else "http"
        lower = [name.lower() for name in names]
        hosts = {f"{name}:{port}" for name in lower}
        if port == _DEFAULT_PORTS[scheme]:
            hosts.update(lower)
        return cls(scheme, frozenset(hosts))

    @property
    def origins(self) -> frozenset[str]:
        """Value of a browser's ``Origin`` header for our own page."""
        return frozenset(f"{self.scheme}://{host}" for host in self.hosts)
