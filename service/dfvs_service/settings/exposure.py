"""Warnings about connections that leave this machine unprotected."""

from dfvs_service.settings.config import ServiceConfig
from dfvs_service.settings.endpoints import is_private_mavlink


def exposure_warnings(config: ServiceConfig) -> tuple[str, ...]:
    """What the settings let others do; logged whenever the service starts."""
    lines = [
        f"{endpoint} is NOT ENCRYPTED: whoever is on that network can see the camera's frames and "
        "send other ones, by which the vehicle would fly (zenoh.allow_plaintext)"
        for endpoint in config.zenoh.exposed
    ]
    if not is_private_mavlink(config.vehicle.mavlink):
        lines.append(
            f"{config.vehicle.mavlink} leaves this machine and MAVLink is NOT SIGNED: whoever is "
            "on that network can command the autopilot"
        )
    return tuple(lines)
