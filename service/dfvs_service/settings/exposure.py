"""Checks of connections that leave this machine unprotected."""

from dfvs_core.gate.checks.preflight import Check
from dfvs_service.settings.config import ServiceConfig
from dfvs_service.settings.mavlink_url import MavlinkUrl


def exposure_checks(config: ServiceConfig) -> tuple[Check, Check]:
    """Advice about connections that anyone on the network could use."""
    exposed, mavlink = config.zenoh.exposed, config.vehicle.mavlink
    lines = ", ".join((*config.zenoh.connect, *config.zenoh.listen))
    if exposed:
        lines = (
            f"{', '.join(exposed)} NOT ENCRYPTED: whoever is on that network can see the camera's "
            "frames and send other ones, by which the vehicle would fly"
        )
    encrypt = "make certificates with dfvs-certs and use tls/ endpoints"
    private = MavlinkUrl.parse(mavlink).is_private
    unsigned = (
        f"{mavlink} leaves this machine and MAVLink is NOT SIGNED: whoever is on that network can "
        "command the autopilot"
    )
    reserve = "use a serial line or a link that nobody else reaches"
    return (
        Check("zenoh", not exposed, lines, encrypt if exposed else "", binding=False),
        Check(
            "mavlink",
            private,
            mavlink if private else unsigned,
            "" if private else reserve,
            binding=False,
        ),
    )
