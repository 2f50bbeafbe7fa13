"""The vehicle's two UDP links, as PX4 opens them: to a companion and to a ground station."""

import select
import socket
from collections.abc import Iterable
from dataclasses import dataclass

from pymavlink.dialects.v20 import development as mavlink

from dfvs_core.errors import ConfigError
from dfvs_sim.vehicle.messages.telemetry import Message

_HOST = "127.0.0.1"
_MAX_DATAGRAMS = 64


@dataclass(frozen=True, slots=True)
class UdpPorts:
    """Where a link lives (0: any free port) and where its peer is expected."""

    local: int
    remote: int


class UdpLink:
    """One link on the loopback interface.

    Until something arrives the messages go to the expected port; from then on to the sender of
    the first packet, as PX4 does.
    """

    def __init__(self, name: str, ports: UdpPorts, system_id: int = 1) -> None:
        self.socket = socket.socket(socket.AF_INET, socket.SOCK_DGRAM)
        try:
            self.socket.bind((_HOST, ports.local))
        except OSError as error:
            self.socket.close()
            raise ConfigError(
                f"UDP port {ports.local} for the {name} link is taken ({error.strerror})",
                "a free port",
                "another vehicle may be running: stop it, or choose other ports",
            ) from error
        self.socket.setblocking(False)
        self.port: int = self.socket.getsockname()[1]
        self._remote = (_HOST, ports.remote)
        self._is_connected = False
        self._packer = mavlink.MAVLink(None, system_id, mavlink.MAV_COMP_ID_AUTOPILOT1)
        self._parser = mavlink.MAVLink(None)
        self._parser.robust_parsing = True

    def receive(self) -> list[Message]:
        """All messages that wait; damaged bytes are skipped."""
        messages: list[Message] = []
        for _ in range(_MAX_DATAGRAMS):
            try:
                data, sender = self.socket.recvfrom(65535)
            except BlockingIOError:
                break
            found = [m for m in self._parser.parse_buffer(data) or () if m.get_type() != "BAD_DATA"]
            if found and not self._is_connected:
                self._remote, self._is_connected = sender, True
            messages.extend(found)
        return messages

    def send(self, message: Message) -> None:
        """Send one message; a full buffer or an absent peer loses it, as on a radio."""
        self.send_bytes(message.pack(self._packer))

    def send_bytes(self, data: bytes) -> None:
        """Send a message that is packed already, such as another component's."""
        try:
            self.socket.sendto(data, self._remote)
        except BlockingIOError:
            return

    def close(self) -> None:
        """Give the port back."""
        self.socket.close()


def wait_for_data(links: Iterable[UdpLink], timeout_s: float) -> None:
    """Sleep until something arrives on a link, or until the timeout."""
    select.select([link.socket for link in links], [], [], max(0.0, timeout_s))
