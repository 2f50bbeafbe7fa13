"""Encryption and reach of Zenoh endpoints."""

import ipaddress

from dfvs_core.messages.zenoh_settings import is_encrypted

_EVERYWHERE = {"0.0.0.0": "127.0.0.1", "[::]": "localhost"}
"""Wildcard addresses, and a name of this machine in each service's certificate."""
_LOCAL = ("unixsock-stream", "unixpipe")


def is_private(endpoint: str) -> bool:
    """Whether a Zenoh endpoint is encrypted or stays on this machine."""
    protocol, _, rest = endpoint.partition("/")
    if is_encrypted(endpoint) or protocol in _LOCAL:
        return True
    return is_loopback(rest.split("#")[0].split("?")[0])


def is_loopback(address: str) -> bool:
    """Whether the host of ``HOST:PORT`` is this machine by a loopback address."""
    return is_loopback_host(address.rsplit(":", 1)[0].strip("[]"))


def is_loopback_host(host: str) -> bool:
    """Whether a host is this machine by a loopback address."""
    try:
        return host == "localhost" or ipaddress.ip_address(host).is_loopback
    except ValueError:
        return False


def here(endpoint: str) -> str:
    """Zenoh endpoint at which a program on this machine meets who listens on ``endpoint``."""
    protocol, _, rest = endpoint.partition("/")
    host, colon, port = rest.rpartition(":")
    return f"{protocol}/{_EVERYWHERE[host]}{colon}{port}" if host in _EVERYWHERE else endpoint
