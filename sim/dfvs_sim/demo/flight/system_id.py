"""One vehicle on both MAVLink links: its system id."""

from dfvs_sim.demo.options import FIRST_SYSTEM_ID, FlightOptions
from dfvs_sim.ground.systems import LinkError, listen_for_systems, system_names
from dfvs_sim.ground.udp import Endpoint

_LISTENED = "udpin:"


def flown_system_id(options: FlightOptions, timeout_s: float) -> int | None:
    """System id of the vehicle that the service will fly, so that the pilot flies the same one.

    A companion link that is listened on (``udpin``) is read before the service takes it; on
    another one the id that was given counts, or None.

    Raises
    ------
    LinkError
        If nobody, several vehicles, or another one than was asked for, are on the companion link.
    """
    if options.autopilot is None:
        return options.system_id or FIRST_SYSTEM_ID
    if not options.autopilot.startswith(_LISTENED):
        return options.system_id
    found = listen_for_systems(Endpoint.from_url(options.autopilot), timeout_s)
    if not found:
        raise LinkError(
            f"no heartbeat from a vehicle on {options.autopilot} within {timeout_s:g} s",
            "a running autopilot",
            "start it, or give its companion link's address",
        )
    if len(found) > 1:
        raise LinkError(
            f"{system_names(found)} are on {options.autopilot}",
            "one vehicle on the link of its companion computer",
            "dfvs-service flies the first one that it hears",
        )
    (system_id,) = found
    if options.system_id not in (None, system_id):
        raise LinkError(
            f"{system_names(found)} is on {options.autopilot}", f"system {options.system_id}"
        )
    return system_id
