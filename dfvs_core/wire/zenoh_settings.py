"""Zenoh session settings that every process of ours opens with, as (key, JSON) pairs.

No multicast, explicit endpoints, small messages, quick reconnection. Two peers that meet through
a router exchange nothing, so with a router the mode is client.
"""

from __future__ import annotations

import json
from typing import Literal

MAX_MESSAGE_BYTES = 8 * 1024 * 1024

ZenohMode = Literal["peer", "client"]


def zenoh_settings(
    mode: ZenohMode, connect: tuple[str, ...], listen: tuple[str, ...]
) -> tuple[tuple[str, str], ...]:
    """Pairs for ``zenoh.Config.insert_json5``.

    Parameters
    ----------
    mode : {"peer", "client"}
        Client when a router is configured, else peer.
    connect, listen : tuple of str
        Endpoints such as ``tcp/127.0.0.1:7447``.
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
    }
    return tuple((key, json.dumps(value)) for key, value in settings.items())
