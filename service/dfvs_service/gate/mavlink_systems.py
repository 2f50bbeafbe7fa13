"""MAVLink systems on a connection: opening it, and finding the autopilot to command."""

import time

from mavsdk import ComponentType, Configuration, Mavsdk
from mavsdk.autopilot import Autopilot as AutopilotType
from mavsdk.system import System
from mavsdk.vehicle import Vehicle

from dfvs_common.status_text import system_names
from dfvs_core.errors import DfvsError

_USUAL_SYSTEM_ID = 1
_POLL_S = 0.05
_AGAIN_S = 10.0
"""Least time for an autopilot to be heard on a connection that was opened again."""


class VehicleError(DfvsError):
    """No autopilot answers, or the connection cannot be opened."""


def connect_autopilot(url: str, system_id: int, timeout_s: float) -> tuple[Mavsdk, System]:
    """Open a connection and wait for its autopilot; blocks.

    MAVSDK hands on only messages to its own system id, or to all. Setpoints of another commander
    are addressed to the autopilot's. So MAVSDK takes the autopilot's system id, as a companion
    computer of the same vehicle does. Where that is not known beforehand and not the usual one,
    the connection is opened once more.

    ``system_id`` is the autopilot's; 0 takes the first autopilot that is heard. ``timeout_s`` is
    the longest wait for its heartbeat.

    Raises
    ------
    VehicleError
        If the connection cannot be opened or no such autopilot is received in time.
    """
    deadline_s = time.monotonic() + timeout_s
    own_id = system_id or _USUAL_SYSTEM_ID
    mavsdk = _open(url, own_id)
    system = _await_autopilot(mavsdk, system_id, timeout_s)
    if system is None:
        raise _silence(mavsdk, url, system_id, timeout_s)
    received_id = int(system.get_system_id())
    if received_id == own_id:
        return mavsdk, system
    mavsdk.destroy()
    again_s = max(deadline_s - time.monotonic(), _AGAIN_S)
    mavsdk = _open(url, received_id)
    system = _await_autopilot(mavsdk, received_id, again_s)
    if system is None:
        raise _silence(mavsdk, url, received_id, again_s)
    return mavsdk, system


def is_autopilot(system: System) -> bool:
    """Whether a system is a vehicle's autopilot, not a ground station, a camera or a radio.

    MAVSDK knows the kind of autopilot and vehicle from heartbeats of autopilots alone.
    """
    is_known = (
        system.autopilot_type() is not AutopilotType.GENERIC
        or system.vehicle_type() is not Vehicle.GENERIC
    )
    return bool(system.has_autopilot()) and is_known


def _open(url: str, own_id: int) -> Mavsdk:
    """Open the connection under a system id of our own."""
    configuration = Configuration.create_with_component_type(ComponentType.COMPANION_COMPUTER)
    configuration.system_id = own_id
    mavsdk = Mavsdk(configuration)
    result = mavsdk.add_any_connection(url)
    if result != 0:
        raise VehicleError(
            f"cannot open the MAVLink connection {url!r} ({result.name})",
            remedy="check vehicle.mavlink, and that no other program uses it",
        )
    return mavsdk


def _await_autopilot(mavsdk: Mavsdk, system_id: int, timeout_s: float) -> System | None:
    """Wait for the autopilot of a system, or for any where the id is 0."""
    deadline_s = time.monotonic() + timeout_s
    while True:
        for system in mavsdk.get_systems():
            if system.has_autopilot() and system_id in (0, int(system.get_system_id())):
                return system
        if time.monotonic() >= deadline_s:
            return None
        time.sleep(_POLL_S)


def _silence(mavsdk: Mavsdk, url: str, system_id: int, timeout_s: float) -> VehicleError:
    """Error that says whose heartbeat is missing, and which autopilots are there instead."""
    others = {int(s.get_system_id()) for s in mavsdk.get_systems() if s.has_autopilot()}
    ours = f"system {system_id}" if system_id else "vehicle"
    but = f", but {system_names(others)}" if others else ""
    remedy = "check vehicle.mavlink and that the autopilot is running"
    return VehicleError(
        f"no {ours} heard on {url} within {timeout_s:g} s{but}",
        "an autopilot's heartbeat",
        f"{remedy}; vehicle.system_id is the autopilot's MAV_SYS_ID" if system_id else remedy,
    )
