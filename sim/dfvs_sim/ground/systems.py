"""MAVLink systems on a link: autopilots on it, and the one that is ours."""

import select
import time
from typing import Any

from pymavlink.dialects.v20 import development as mavlink

from dfvs_common.status_text import system_names
from dfvs_core.errors import DfvsError
from dfvs_sim.ground.udp import Endpoint

HEARTBEATS_S = 1.5
"""Every autopilot on a link sends within this time: heartbeats come once a second."""


class LinkError(DfvsError):
    """The vehicle does not answer on the ground-station link."""


class Autopilots:
    """Autopilots on a link, by their heartbeats; no ``system_id`` takes the first one for ours."""

    def __init__(self, system_id: int | None = None) -> None:
        self.wanted = system_id
        self.chosen: int | None = None
        self.chosen_ns = 0
        """When ours was seen first, monotonic."""
        self.seen: set[int] = set()

    def update(self, message: Any, t_ns: int) -> bool:
        """Take a message; True if it makes its sender ours."""
        if not is_autopilot_heartbeat(message):
            return False
        system = message.get_srcSystem()
        self.seen.add(system)
        if self.chosen is not None or self.wanted not in (None, system):
            return False
        self.chosen, self.chosen_ns = system, t_ns
        return True

    def is_ours(self, message: Any) -> bool:
        """Whether our vehicle's autopilot sent the message."""
        sender = message.get_srcSystem(), message.get_srcComponent()
        return sender == (self.chosen, mavlink.MAV_COMP_ID_AUTOPILOT1)

    @property
    def others(self) -> set[int]:
        """System ids that are not ours."""
        return self.seen - {self.chosen}

    def silence_error(self, url: str, timeout_s: float) -> LinkError:
        """Error that says whose heartbeat is missing, and who is there instead."""
        ours = "a vehicle" if self.wanted is None else system_names({self.wanted})
        others = f", only {system_names(self.seen)}" if self.seen else ""
        return LinkError(
            f"no heartbeat from {ours} on {url} within {timeout_s:g} s{others}",
            "a running autopilot",
            "start it (dfvs-sim vehicle, or PX4), or give its address",
        )

    def ambiguity_error(self, url: str) -> LinkError:
        """Error that names the vehicles that could all be ours."""
        return LinkError(
            f"{system_names(self.seen)} are on {url}", "one vehicle, or the system id of ours"
        )


def is_autopilot_heartbeat(message: Any) -> bool:
    """Whether a message is the heartbeat of an autopilot (not of a camera or a radio)."""
    return bool(
        message.get_type() == "HEARTBEAT"
        and message.get_srcComponent() == mavlink.MAV_COMP_ID_AUTOPILOT1
        and message.autopilot != mavlink.MAV_AUTOPILOT_INVALID
    )


def listen_for_systems(endpoint: Endpoint, timeout_s: float) -> set[int]:
    """Ids of the autopilots that send to a port (``udpin``); nothing is sent.

    Waits ``timeout_s`` for the first heartbeat, and listens for ``HEARTBEATS_S`` after it.

    Raises
    ------
    ConfigError
        If the port is taken.
    """
    parser = mavlink.MAVLink(None)
    parser.robust_parsing = True
    found: set[int] = set()
    deadline_s = time.monotonic() + timeout_s
    with endpoint.open() as sock:
        while (left_s := deadline_s - time.monotonic()) > 0:
            if not select.select([sock], [], [], left_s)[0]:
                break
            for message in parser.parse_buffer(sock.recv(65535)) or ():
                if is_autopilot_heartbeat(message):
                    if not found:
                        deadline_s = time.monotonic() + HEARTBEATS_S
                    found.add(message.get_srcSystem())
    return found
