"""Who may order: challenges that are used once, and the check of a command's signature."""

from __future__ import annotations

import hmac
from collections.abc import Callable
from dataclasses import dataclass

from dfvs_core.errors import WireError
from dfvs_core.gate.config import S
from dfvs_core.gate.events import Action
from dfvs_core.wire.command import SignedCommand, command_mac, decode_command

ROTATION_NS = 10 * S


@dataclass(frozen=True, slots=True)
class Verdict:
    """What became of a command: what it orders if it is authentic, and one line for the log."""

    action: Action | None
    text: str
    argument: str = ""


class Authority:
    """Accepts each signed command once.

    Parameters
    ----------
    key : bytes or None
        Shared secret; None accepts nothing.
    vehicle : str
        Name that commands must carry.
    draw : callable
        Gives a fresh unpredictable challenge.
    t_ns : int
        Monotonic time.
    """

    def __init__(self, key: bytes | None, vehicle: str, draw: Callable[[], str], t_ns: int) -> None:
        self._key = key
        self._vehicle = vehicle
        self._draw = draw
        self._current = draw()
        self._previous: str | None = None
        self._drawn_ns = t_ns

    def challenge(self, now_ns: int) -> str:
        """Challenge that the next command must carry; empty where no command is accepted."""
        if self._key is None:
            return ""
        self._rotate(now_ns)
        return self._current

    def judge(self, data: bytes, now_ns: int) -> Verdict:
        """Tell whether a command is authentic, fresh and for this vehicle; use up its challenge."""
        if self._key is None:
            return Verdict(None, "rejected: no command key is configured")
        self._rotate(now_ns)
        try:
            command = decode_command(data)
        except WireError as error:
            return Verdict(None, f"rejected: {error}")
        if command.vehicle != self._vehicle:
            return Verdict(None, f"rejected: command for another vehicle, {command.vehicle!r}")
        if command.challenge not in (self._current, self._previous):
            return Verdict(None, "rejected: its challenge was used or is too old")
        if not self._is_signed(self._key, command):
            return Verdict(None, "rejected: wrong signature")
        self._use_up(command.challenge, now_ns)
        return Verdict(command.action, f"accepted: {command.action}", command.argument)

    @staticmethod
    def _is_signed(key: bytes, command: SignedCommand) -> bool:
        challenge, argument = command.challenge, command.argument
        mac = command_mac(key, command.vehicle, command.action, challenge, argument)
        return hmac.compare_digest(mac.encode(), command.mac.encode(errors="replace"))

    def _rotate(self, now_ns: int) -> None:
        passed = (now_ns - self._drawn_ns) // ROTATION_NS
        if passed < 1:
            return
        self._previous = self._current if passed == 1 else None
        self._current = self._draw()
        self._drawn_ns = now_ns

    def _use_up(self, challenge: str, now_ns: int) -> None:
        """Forget a challenge; a used current one is replaced, and drags no older one along."""
        self._previous = None
        if challenge == self._current:
            self._current = self._draw()
            self._drawn_ns = now_ns
