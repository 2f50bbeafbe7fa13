"""Addresses of the dashboard's page."""

from __future__ import annotations

import re
from collections.abc import Iterable
from dataclasses import dataclass

_DEFAULT_PORTS = {"http": 80, "https": 443}
_LOOPBACK = re.compile(r"(127\.0\.0\.1|localhost|\[::1\])(:\d+)?")
"""This machine, on any port: that of an SSH tunnel is not ours."""


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

    def is_served(self, host: str) -> bool:
        """Whether a browser's ``Host`` header names this page."""
        return host.lower() in self.hosts or _LOOPBACK.fullmatch(host.lower()) is not None

    def is_own_origin(self, origin: str, host: str) -> bool:
        """Whether a browser's ``Origin`` header is that of the page at ``host``."""
        return origin.lower() == f"{self.scheme}://{host.lower()}"
