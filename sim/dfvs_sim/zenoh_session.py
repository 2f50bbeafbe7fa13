"""Opening the simulator's Zenoh session."""

from __future__ import annotations

import zenoh

from dfvs_core.errors import ConfigError
from dfvs_core.messages.zenoh_settings import ZenohMode, zenoh_settings


def open_peer(endpoint: str) -> zenoh.Session:
    """Peer that connects to the service's endpoint, now or as soon as it is there.

    Raises
    ------
    ConfigError
        If the endpoint is none.
    """
    return _open("peer", endpoint)


def open_client(endpoint: str) -> zenoh.Session:
    """Client of a router that runs.

    Raises
    ------
    ConfigError
        If the router cannot be reached.
    """
    return _open("client", endpoint)


def _open(mode: ZenohMode, endpoint: str) -> zenoh.Session:
    settings = zenoh.Config()
    for key, value in zenoh_settings(mode, (endpoint,), ()):
        settings.insert_json5(key, value)
    try:
        return zenoh.open(settings)
    except zenoh.ZError as error:
        raise ConfigError(
            f"Zenoh cannot be opened: {str(error).split(' at /')[0]}",
            "an endpoint such as tcp/127.0.0.1:7447",
        ) from error
