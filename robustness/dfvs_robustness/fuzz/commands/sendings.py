"""What operators, their networks and their enemies send, one thing at a time."""

import heapq
from collections import deque

from dfvs_core.gate.commands.command import Command, SignedCommand, command_mac, encode_command
from dfvs_core.gate.config import MS, S
from dfvs_core.gate.events import Action
from dfvs_core.messages.goal_command import goal_digest
from dfvs_core.messages.schema import to_json
from dfvs_robustness.fuzz.commands.ingress import KEY, VEHICLE, Sending
from dfvs_robustness.fuzz.random_source import RandomSource

_BAD = (
    *("delayed",) * 2,
    *("expired", "unknown challenge", "other key", "other vehicle", "unsigned", "relabelled"),
    *("mangled", "truncated", "oversized", "rubbish", "other goal"),
)
_KINDS = (
    *("fresh",) * 6,
    *("goal",) * 2,
    *("repeated",) * 4,
    *("replayed",) * 3,
    *("extended", "goal repeated"),
    *_BAD,
)
_ACTIONS = tuple(action for action in Action if action is not Action.GOAL)
_GAPS_NS = (0, MS // 2, 10 * MS, 50 * MS, 50 * MS, 50 * MS, 100 * MS, 300 * MS)
_RARE_GAPS_NS = (S, 5 * S, 10 * S - 1, 10 * S, 15 * S, 20 * S, 70 * S)
_PACES: tuple[tuple[tuple[str, ...], tuple[int, ...], float], ...] = (
    (_KINDS, _GAPS_NS, 0.004),
    (_BAD, _GAPS_NS, 0.05),
    (_KINDS, (0, MS // 2), 0.0),
)
"""Kinds, gaps and share of rare gaps: as usual; no operator, so that challenges expire; a flood."""
_DELAY_NS = 25 * S
_REMEMBERED = 256


class Sender:
    """Everybody who sends; ``rng`` makes all choices."""

    def __init__(self, rng: RandomSource, born_ns: int) -> None:
        self._rng = rng
        self._now_ns = born_ns
        self._sent: deque[Sending] = deque(maxlen=_REMEMBERED)
        self._goals: deque[Sending] = deque(maxlen=8)
        self._published: deque[str] = deque(maxlen=8)
        self._delayed: list[tuple[int, bytes]] = []
        self._pace = _PACES[0]

    def next_time(self) -> int:
        """Monotonic time of the next sending, ns."""
        if self._rng.chance(0.01):
            self._pace = self._rng.pick(_PACES)
        _, usual, rare = self._pace
        gaps = _RARE_GAPS_NS if self._rng.chance(rare) else usual
        self._now_ns += self._rng.pick(gaps)
        return self._now_ns

    def next(self, challenge: str) -> Sending:
        """Next sending, by somebody who knows the challenge that is published now."""
        if challenge not in self._published:
            self._published.append(challenge)
        if self._delayed and self._delayed[0][0] <= self._now_ns:
            command = heapq.heappop(self._delayed)[1]
            return self._remember(Sending(self._now_ns, command, None, "late"))
        kind = self._rng.pick(self._pace[0])
        if kind in ("repeated", "replayed") and self._sent:
            newest = 0 if kind == "replayed" else max(len(self._sent) - 8, 0)
            old = self._sent[self._rng.integer(newest, len(self._sent) - 1)]
            return Sending(self._now_ns, old.command, old.goal, kind)
        if kind in ("goal", "other goal", "goal repeated"):
            return self._goal(kind, challenge)
        command = self._command(kind, challenge)
        if kind == "delayed":
            due_ns = self._now_ns + int(_DELAY_NS * self._rng.uniform() ** 3)
            heapq.heappush(self._delayed, (due_ns, command))
            command = command[: len(command) // 2]
        return self._remember(Sending(self._now_ns, command, None, kind))

    def _remember(self, sending: Sending) -> Sending:
        self._sent.append(sending)
        return sending

    def _hexadecimal(self) -> str:
        high, low = (self._rng.integer(0, 2**32 - 1) for _ in range(2))
        return f"{high:016x}{low:016x}"

    def _signable(self, challenge: str, vehicle: str = VEHICLE) -> Command:
        return Command(vehicle, self._rng.pick(_ACTIONS), challenge, self._hexadecimal())

    def _goal(self, kind: str, challenge: str) -> Sending:
        if kind == "goal repeated" and self._goals:
            old = self._rng.pick(self._goals)
            return Sending(self._now_ns, old.command, old.goal, kind)
        goal = self._hexadecimal().encode()
        command = Command(VEHICLE, Action.GOAL, challenge, self._hexadecimal(), goal_digest(goal))
        signed = encode_command(KEY, command)
        if kind == "other goal":
            return Sending(self._now_ns, signed, goal[1:], kind)
        sending = Sending(self._now_ns, signed, goal, kind)
        self._goals.append(sending)
        return self._remember(sending)

    def _command(self, kind: str, challenge: str) -> bytes:
        """Bytes of a command of that kind."""
        rng = self._rng
        if kind == "rubbish":
            return rng.rng.bytes(rng.integer(0, 1200))
        if kind == "expired":
            challenge = rng.pick(self._published)
        elif kind == "unknown challenge":
            challenge = self._hexadecimal()
        command = self._signable(challenge, "drone2" if kind == "other vehicle" else VEHICLE)
        if kind == "unsigned":
            return to_json(SignedCommand(command, ""))
        if kind == "relabelled":
            other = self._signable(challenge)
            return to_json(SignedCommand(other, command_mac(KEY, command)))
        data = encode_command(b"x" * 32 if kind == "other key" else KEY, command)
        place = rng.integer(0, len(data) - 1)
        if kind == "mangled":
            return data[:place] + bytes([data[place] ^ 1 << rng.integer(0, 7)]) + data[place + 1 :]
        if kind == "truncated":
            return data[:place]
        if kind == "extended":
            return data + b" " * rng.integer(1, 8)
        if kind == "oversized":
            return data + b" " * rng.integer(1024, 4096)
        return data
