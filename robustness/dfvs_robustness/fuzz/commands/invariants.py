"""Invariants of every command that arrives, evaluated anew from its bytes.

- authentic: an accepted command was signed with the key, for this vehicle, with this content.
- fresh: its challenge was published at most 30 s ago (three periods, one may be lost), never used.
- once: an accepted command is never accepted again.
- answer: the same bytes get the same answer, as long as it is among the last 64 that count.
- obeyed: a command that is signed, new and carries the published challenge is accepted.
- rate: 20 commands and 2 goals a second pass, plus a burst of 20 and 4.
- memory: the whole takes at most 16 KiB.
"""

import hashlib
import hmac
import json
import pickle
from collections import OrderedDict, deque
from typing import Any

from dfvs_core.gate.commands.command import Command, encode_command
from dfvs_core.gate.config import S
from dfvs_core.gate.events import Action
from dfvs_robustness.fuzz.commands.ingress import KEY, REFUSAL, VEHICLE, Ingress, Passed, Sending
from dfvs_robustness.fuzz.finding import InvariantError

_LIFETIME_NS = 30 * S
_KEPT_ANSWERS = 64
_WINDOWS_S = (0.1, 1.0, 10.0)
_MOST_COMMANDS, _MOST_GOALS = (20, 20), (4, 2)
"""Burst, and rate per s."""
_MOST_BYTES = 16 * 1024
_MEASURE_EVERY = 500


class CommandChecker:
    """Follows one ingress from its birth."""

    def __init__(self) -> None:
        self._published_ns: OrderedDict[str, int] = OrderedDict()
        """When each challenge was first published."""
        self._used: set[str] = set()
        self._obeyed: set[bytes] = set()
        self._answers: OrderedDict[bytes, str] = OrderedDict()
        self._passed_ns: deque[int] = deque()
        self._goals_ns: deque[int] = deque()
        self._count = 0

    def see_challenge(self, challenge: str, now_ns: int) -> None:
        """Take the challenge that is published at ``now_ns``."""
        self._published_ns.setdefault(challenge, now_ns)

    def check(
        self, sending: Sending, challenge: str, passed: Passed | None, ingress: Ingress
    ) -> None:
        """Judge what became of a sending that arrived while ``challenge`` was published.

        Raises
        ------
        InvariantError
            If it must not have.
        """
        self._count += 1
        if self._count % _MEASURE_EVERY == 0:
            _check_memory(ingress)
        if passed is None:
            return
        self._check_rate(self._passed_ns, sending.t_ns, *_MOST_COMMANDS)
        if sending.goal is not None:
            self._check_rate(self._goals_ns, sending.t_ns, *_MOST_GOALS)
        self._check_answer(passed)
        if passed.answer.action is None:
            if passed.command not in self._obeyed and self._is_due(passed.command, challenge):
                raise InvariantError("obeyed", f"a good command got {passed.answer.text!r}")
            return
        self._check_obeyed(sending, passed)

    def _check_answer(self, passed: Passed) -> None:
        answer = passed.answer
        if answer.request != hashlib.sha256(passed.command).hexdigest()[:32]:
            raise InvariantError("answer", "an answer names another request")
        kept = self._answers.get(passed.command)
        if kept is not None and (answer.action is not None or answer.text != kept):
            raise InvariantError("answer", f"first {kept!r}, then {answer.text!r}")
        if answer.is_repeated is not (kept is not None):
            raise InvariantError("answer", f"repeated: {answer.is_repeated}, kept: {kept!r}")

    def _check_obeyed(self, sending: Sending, passed: Passed) -> None:
        answer, now_ns = passed.answer, sending.t_ns
        signed = _signed(passed.command)
        said = (answer.action, answer.argument)
        if signed is None or (signed["action"], signed["argument"]) != said:
            raise InvariantError("authentic", f"obeyed {said} of {passed.command!r}")
        if passed.command in self._obeyed:
            raise InvariantError("once", f"obeyed {said} twice")
        challenge = signed["challenge"]
        published_ns = self._published_ns.get(challenge)
        if published_ns is None or now_ns - published_ns >= _LIFETIME_NS or challenge in self._used:
            raise InvariantError(
                "fresh", f"challenge published at {published_ns}, obeyed at {now_ns}"
            )
        if sending.goal is not None and answer.argument != hashlib.sha256(sending.goal).hexdigest():
            raise InvariantError("authentic", "a goal is not the one that was signed")
        self._used.add(challenge)
        self._obeyed.add(passed.command)
        text = REFUSAL if answer.action is Action.ABORT else answer.text
        self._answers[passed.command] = text
        if len(self._answers) > _KEPT_ANSWERS:
            self._answers.popitem(last=False)

    def _is_due(self, data: bytes, challenge: str) -> bool:
        """Whether a command is exactly what a good operator sends now."""
        signed = _signed(data)
        if signed is None or signed["challenge"] != challenge:
            return False
        return encode_command(KEY, Command(**signed)) == data

    @staticmethod
    def _check_rate(times_ns: deque[int], now_ns: int, burst: int, per_s: int) -> None:
        times_ns.append(now_ns)
        while times_ns[0] < now_ns - _WINDOWS_S[-1] * S:
            times_ns.popleft()
        for window_s in _WINDOWS_S:
            most = int(burst + per_s * window_s)
            if len(times_ns) > most and times_ns[-most - 1] > now_ns - window_s * S:
                raise InvariantError("rate", f"over {most} passed in {window_s:g} s")


def _check_memory(ingress: Ingress) -> None:
    size = len(pickle.dumps(ingress))
    if size > _MOST_BYTES:
        raise InvariantError("memory", f"{size} bytes")


def _signed(data: bytes) -> dict[str, Any] | None:
    """Fields of a command that our key signed for our vehicle; None for all else."""
    try:
        document = json.loads(data)
        fields = document["command"]
        names = ("vehicle", "action", "challenge", "nonce", "argument")
        text = json.dumps([document["format"], *(fields[name] for name in names)])
        mac = hmac.new(KEY, text.encode(), hashlib.sha256).hexdigest()
    except (ValueError, LookupError, TypeError, RecursionError):
        return None
    good = document.get("mac") == mac and fields["vehicle"] == VEHICLE
    return {name: fields[name] for name in names} if good else None
