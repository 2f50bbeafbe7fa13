"""One vehicle on both MAVLink links: its system id."""

from dfvs_common.status_text import system_names
from dfvs_sim.demo.options import FIRST_SYSTEM_ID, FlightOptions
from dfvs_sim.ground.systems import LinkError, listen_for_systems
from dfvs_sim.ground.udp import Endpoint

_LISTENED = "udpin:"


def flown_system_id(options: FlightOptions, timeout_s: float) -> int | None:
    """System id of the vehicle that the service will fly, so that the pilot flies the same one.

    A companion link that is listened on (``udpin``) is read before the service takes it; on
    another one the id that was given counts, or None.

    Raises
    ------
    LinkError
        If the vehicle that was asked for is not on the companion link, or if none was asked for
        and there is none, or several.
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
    if options.system_id is not None and options.system_id not in found:
        verb = "are" if len(found) > 1 else "is"
        raise LinkError(
            f"{system_names(found)} {verb} on {options.autopilot}", f"system {options.system_id}"
        )
    if options.system_id is None and len(found) > 1:
        raise LinkError(
            f"{system_names(found)} are on {options.autopilot}",
            "one vehicle on the link of its companion computer, or the system id of ours",
            "give --system-id",
        )
    return options.system_id or found.pop()
