"""Command authority: single-use challenges, signature check, and answers by request id."""

import hmac
from collections import OrderedDict
from collections.abc import Callable
from dataclasses import dataclass

from dfvs_core.errors import WireError
from dfvs_core.gate.commands.command import SignedCommand, command_mac, decode_command, request_id
from dfvs_core.gate.config import S
from dfvs_core.gate.events import Action

ROTATION_NS = 10 * S
MAX_ANSWERS = 64
"""Accepted commands whose answers are kept, newest last."""


@dataclass(frozen=True, slots=True)
class AuthorityAnswer:
    """Answer to a command.

    ``request`` is the command's request id and ``text`` the answer, one line. ``action`` is what
    must be done now: None where the command is rejected, and where it was accepted before.
    ``is_repeated`` marks the latter.
    """

    action: Action | None
    text: str
    argument: str = ""
    request: str = ""
    is_repeated: bool = False


class Authority:
    """Accepts each signed command once, and repeats its answer for the same bytes.

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
        self._answers: OrderedDict[str, str] = OrderedDict()
        """Answers to accepted commands, by request id."""

    def challenge(self, now_ns: int) -> str:
        """Challenge that the next command must carry; empty where no command is accepted."""
        if self._key is None:
            return ""
        self._rotate(now_ns)
        return self._current

    def evaluate(self, data: bytes, now_ns: int) -> AuthorityAnswer:
        """Answer a command; what is authentic, fresh and for this vehicle uses up its challenge.

        The bytes of an accepted command get its answer again, and no action.
        """
        request = request_id(data)
        if (answer := self._answers.get(request)) is not None:
            return AuthorityAnswer(None, answer, request=request, is_repeated=True)
        key = self._key
        if key is None:
            return AuthorityAnswer(None, "rejected: no command key is configured", request=request)
        self._rotate(now_ns)
        try:
            signed = decode_command(data)
        except WireError as error:
            return AuthorityAnswer(None, f"rejected: {error}", request=request)
        command = signed.command
        if reason := self._objection(key, signed):
            return AuthorityAnswer(None, f"rejected: {reason}", request=request)
        self._use_up(command.challenge, now_ns)
        text = f"accepted: {command.action}"
        self.record(request, text)
        return AuthorityAnswer(command.action, text, command.argument, request)

    def record(self, request: str, answer: str) -> None:
        """Keep the answer to an accepted command, in place of an earlier one."""
        self._answers[request] = answer
        if len(self._answers) > MAX_ANSWERS:
            self._answers.popitem(last=False)

    def _objection(self, key: bytes, signed: SignedCommand) -> str:
        """Say why a command is not obeyed, empty where it is."""
        command = signed.command
        if command.vehicle != self._vehicle:
            return f"command for another vehicle, {command.vehicle!r}"
        if command.challenge not in (self._current, self._previous):
            return "its challenge was used or is too old"
        mac = command_mac(key, command)
        if not hmac.compare_digest(mac.encode(), signed.mac.encode(errors="replace")):
            return "wrong signature, use the key of this vehicle (gate.command_key_file)"
        return ""

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
