"""Free places on the loopback interface, and Zenoh peers between them."""

import socket
from collections.abc import Iterator
from contextlib import contextmanager

import zenoh

from dfvs_core.messages.zenoh_settings import zenoh_settings


def free_tcp_port() -> int:
    """Return a TCP port that nobody listens at now."""
    with socket.socket() as probe:
        probe.bind(("127.0.0.1", 0))
        return int(probe.getsockname()[1])


def free_endpoint() -> str:
    """Zenoh endpoint at a free port."""
    return f"tcp/127.0.0.1:{free_tcp_port()}"


def peer(connect: tuple[str, ...] = (), listen: tuple[str, ...] = ()) -> zenoh.Session:
    """Zenoh peer as the service and its cameras open it."""
    settings = zenoh.Config()
    for key, value in zenoh_settings("peer", connect, listen):
        settings.insert_json5(key, value)
    return zenoh.open(settings)


@contextmanager
def listening_peer() -> Iterator[tuple[zenoh.Session, str]]:
    """Zenoh peer as a service opens it, and where it listens."""
    endpoint = free_endpoint()
    with peer(listen=(endpoint,)) as session:
        yield session, endpoint
