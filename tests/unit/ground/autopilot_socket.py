"""An autopilot's socket, as far as a ground station hears it."""

from __future__ import annotations

import socket
from typing import Any

from pymavlink.dialects.v20 import development as mavlink


class Autopilot:
    """An autopilot's UDP socket that sends to a ground station's port."""

    def __init__(self, system: int, port: int) -> None:
        self.socket = socket.socket(socket.AF_INET, socket.SOCK_DGRAM)
        self.socket.bind(("127.0.0.1", 0))
        self.socket.settimeout(2.0)
        self._peer = ("127.0.0.1", port)
        self._mav = mavlink.MAVLink(None, system, mavlink.MAV_COMP_ID_AUTOPILOT1)

    def __enter__(self) -> Autopilot:
        return self

    def __exit__(self, *_: object) -> None:
        self.socket.close()

    def send(self, message: Any) -> None:
        self.socket.sendto(message.pack(self._mav), self._peer)

    def beat(self) -> None:
        kind, autopilot = mavlink.MAV_TYPE_QUADROTOR, mavlink.MAV_AUTOPILOT_PX4
        self.send(mavlink.MAVLink_heartbeat_message(kind, autopilot, 0, 0, 3, 3))

    def hears_something(self) -> bool:
        try:
            return bool(self.socket.recvfrom(65535))
        except TimeoutError:
            return False
