"""MAVLink URL of a connection, as MAVSDK takes it."""

import re
from dataclasses import dataclass
from pathlib import Path
from typing import Self

from dfvs_core.errors import ConfigError
from dfvs_service.settings.endpoints import is_loopback_host

_SERIAL = r"(serial|serial_flowcontrol)://(/.+):([0-9]+)"
_NETWORK = (
    r"(udpin|tcpin)://([0-9.]+):([0-9]+)",
    r"(udpout|tcpout)://([^:/\s]+):([0-9]+)",
    r"(udp|tcp)://([^:/\s]*):([0-9]+)",
)


@dataclass(frozen=True, slots=True)
class MavlinkUrl:
    """Parts of a MAVLink URL; ``device`` is that of a serial line, None for a network's URL.

    ``number`` is the port, or the baud rate of a serial line.
    """

    scheme: str
    host: str
    number: int
    device: Path | None = None

    @classmethod
    def parse(cls, text: str) -> Self:
        """Read the URL of ``vehicle.mavlink``.

        Raises
        ------
        ConfigError
            If MAVSDK does not take it.
        """
        if match := re.fullmatch(_SERIAL, text):
            return cls(match[1], "", int(match[3]), Path(match[2]))
        for pattern in _NETWORK:
            match = re.fullmatch(pattern, text)
            if match is not None and 0 < int(match[3]) <= 65535:
                return cls(match[1], match[2], int(match[3]))
        raise ConfigError(
            f"vehicle.mavlink = {text!r}",
            "udpin://ADDRESS:PORT, udpout://HOST:PORT or serial:///dev/ttyACM0:921600",
            "a simulated PX4 sends to udpin://127.0.0.1:14540",
        )

    @property
    def is_private(self) -> bool:
        """Whether the connection is a serial line or stays on this machine."""
        return self.device is not None or is_loopback_host(self.host)
