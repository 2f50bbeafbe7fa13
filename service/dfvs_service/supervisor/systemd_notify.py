"""Notifications to systemd (sd_notify): readiness and watchdog."""

import contextlib
import socket
from collections.abc import Mapping


class Notifier:
    """Notifies systemd that the service is up and alive; without systemd it does nothing.

    ``NOTIFY_SOCKET`` in ``environment`` is systemd's address.
    """

    def __init__(self, environment: Mapping[str, str]) -> None:
        address = environment.get("NOTIFY_SOCKET", "")
        # A name that begins with @ is an abstract one, which the kernel spells with a zero byte.
        self._address = "\0" + address[1:] if address.startswith("@") else address
        self._socket = socket.socket(socket.AF_UNIX, socket.SOCK_DGRAM)
        self._socket.setblocking(False)

    def ready(self) -> None:
        """Say that the service is up."""
        self._send("READY=1")

    def alive(self) -> None:
        """Say that the service is alive."""
        self._send("WATCHDOG=1")

    def stopping(self) -> None:
        """Say that the service is about to end."""
        self._send("STOPPING=1")

    def close(self) -> None:
        """Say nothing more."""
        self._socket.close()

    def _send(self, text: str) -> None:
        # Whoever does not listen must not end a flight.
        if self._address:
            with contextlib.suppress(OSError):
                self._socket.sendto(text.encode(), self._address)
