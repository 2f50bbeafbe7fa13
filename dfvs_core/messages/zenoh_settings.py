"""Zenoh session settings as (key, JSON) pairs.

No multicast, explicit endpoints, small messages, quick reconnection. Two peers that meet through
a router exchange nothing, so with a router the mode is client. With certificates both ends of a
link prove who they are, and whoever listens lets every name do its role's work alone.
"""

import json
from dataclasses import dataclass
from typing import Any, Literal

from dfvs_core.messages.schema import setting
from dfvs_core.messages.zenoh_access import access_control

MAX_MESSAGE_BYTES = 8 * 1024 * 1024

ZenohMode = Literal["peer", "client", "router"]


def is_encrypted(endpoint: str) -> bool:
    """Whether an endpoint needs certificates."""
    return endpoint.partition("/")[0] in ("tls", "quic")


@dataclass(frozen=True, slots=True)
class TlsFiles:
    """PEM files by which one end of an encrypted link proves who it is."""

    ca: str = setting("", "certificate of the authority that both ends trust")
    certificate: str = setting("", "own certificate; its name is the role")
    key: str = setting("", "its private key (mode 0600)")


@dataclass(frozen=True, slots=True)
class Encryption:
    """Own files, and the vehicles whose roles may do their work over a link to this process."""

    files: TlsFiles
    vehicles: tuple[str, ...] = ()


def zenoh_settings(
    mode: ZenohMode,
    connect: tuple[str, ...],
    listen: tuple[str, ...],
    encryption: Encryption | None = None,
) -> tuple[tuple[str, str], ...]:
    """Pairs for ``zenoh.Config.insert_json5``.

    Parameters
    ----------
    mode : {"peer", "client", "router"}
        Client when a router is configured, else peer.
    connect, listen : tuple of str
        Endpoints such as ``tcp/127.0.0.1:7447``.
    encryption : Encryption, optional
        For endpoints that begin with ``tls/``.
    """
    settings = {
        "mode": mode,
        "connect/endpoints": list(connect),
        "connect/timeout_ms": 0 if mode == "client" else -1,
        "connect/exit_on_failure": mode == "client",
        "connect/retry": {
            "period_init_ms": 200,
            "period_max_ms": 500,
            "period_increase_factor": 1.5,
        },
        "listen/endpoints": list(listen),
        "scouting/multicast/enabled": False,
        # What is kept for late subscribers must carry a time.
        "timestamping/enabled": True,
        "transport/link/tx/lease": 2000,
        "transport/link/rx/max_message_size": MAX_MESSAGE_BYTES,
        # Who has mapped another process's segment may keep it, 16 MB, when that process ends.
        "transport/shared_memory/enabled": False,
    }
    if encryption is not None:
        settings["transport/link/tls"] = _tls(encryption.files)
        if listen:
            settings["access_control"] = access_control(encryption.vehicles)
    return tuple((key, json.dumps(value)) for key, value in settings.items())


def _tls(files: TlsFiles) -> dict[str, Any]:
    """Both ends show a certificate of the same authority, and names are checked."""
    return {
        "root_ca_certificate": files.ca,
        "enable_mtls": True,
        "listen_certificate": files.certificate,
        "listen_private_key": files.key,
        "connect_certificate": files.certificate,
        "connect_private_key": files.key,
        "verify_name_on_connect": True,
        "close_link_on_expiration": True,
    }
