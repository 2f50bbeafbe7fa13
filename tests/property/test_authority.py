"""Whatever is sent, in any order, at any time: a command counts once, soon, for one vehicle."""

import dataclasses
import itertools
import json

from hypothesis import given, settings
from hypothesis import strategies as st
from signed_commands import signed

from dfvs_core.gate.commands.authority import ROTATION_NS, Authority
from dfvs_core.gate.commands.command import decode_command, request_id
from dfvs_core.gate.config import S
from dfvs_core.gate.events import Action

OURS, THEIRS = b"o" * 32, b"t" * 32
DIGESTS = ("ab" * 32, "cd" * 32)
LONGEST_LIFE_NS = 2 * ROTATION_NS


@dataclasses.dataclass
class Attempt:
    """A command as it is sent, and what is known of it."""

    data: bytes
    drawn_ns: int
    is_good: bool


class World:
    """A vehicle's authority, its challenges as everybody sees them, and commands so far."""

    def __init__(self):
        numbers = itertools.count()
        self.now_ns = 1_000 * S
        self.authority = Authority(OURS, "drone1", lambda: f"c{next(numbers)}", self.now_ns)
        self.seen = {}
        self.attempts = []
        self.accepted = []
        self.answers = {}
        """Answers to accepted commands, by request id."""
        self.look()

    def look(self):
        challenge = self.authority.challenge(self.now_ns)
        self.seen.setdefault(challenge, self.now_ns)
        return challenge

    def sign(self, key, vehicle, action, challenge):
        argument = DIGESTS[0] if action is Action.GOAL else ""
        data = signed(key, vehicle, action, challenge, argument)
        good = key == OURS and vehicle == "drone1"
        self.attempts.append(Attempt(data, self.seen[challenge], good))

    def send(self, attempt):
        verdict = self.authority.evaluate(attempt.data, self.now_ns)
        assert verdict.request == request_id(attempt.data)
        if verdict.is_repeated:
            assert verdict.action is None
            assert verdict.text == self.answers[verdict.request]
            return
        assert verdict.request not in self.answers
        assert verdict.text.startswith("accepted" if verdict.action else "rejected: ")
        if verdict.action is None:
            return
        self.answers[verdict.request] = verdict.text
        command = decode_command(attempt.data).command
        assert attempt.is_good
        assert command.action is verdict.action
        assert command.argument == verdict.argument
        assert command.challenge not in self.accepted
        # First seen is later than drawn by at most the time between two looks.
        assert self.now_ns - attempt.drawn_ns < LONGEST_LIFE_NS
        self.accepted.append(command.challenge)


tampering = st.sampled_from(
    [
        {"vehicle": "drone2"},
        {"action": "engage"},
        {"action": "goal", "argument": DIGESTS[1]},
        {"argument": DIGESTS[1]},
        {"challenge": "c0"},
        {"mac": "0" * 64},
        {"format": "dfvs-command/1"},
        {"nonce": "0" * 32},
    ]
)


@settings(max_examples=200)
@given(st.data())
def test_nothing_but_a_fresh_authentic_command_is_ever_accepted_and_once(data):
    world = World()
    for _ in range(data.draw(st.integers(1, 40))):
        step = data.draw(st.sampled_from(["wait", "sign", "send", "replay", "tamper"]))
        if step == "wait":
            world.now_ns += data.draw(st.integers(0, 25 * S))
            world.look()
        elif step == "sign" or not world.attempts:
            key = data.draw(st.sampled_from([OURS, OURS, THEIRS]))
            vehicle = data.draw(st.sampled_from(["drone1", "drone1", "drone2"]))
            challenge = data.draw(st.sampled_from(sorted(world.seen)))
            world.sign(key, vehicle, data.draw(st.sampled_from(Action)), challenge)
        elif step == "tamper":
            old = data.draw(st.sampled_from(world.attempts))
            document = json.loads(old.data)
            changes = data.draw(tampering)
            parts = {name: changes[name] for name in ("mac", "format") if name in changes}
            inner = {name: value for name, value in changes.items() if name not in parts}
            changed = {**document, **parts, "command": {**document["command"], **inner}}
            forged = Attempt(json.dumps(changed).encode(), old.drawn_ns, changed == document)
            world.send(forged if changed != document else old)
        else:
            world.send(data.draw(st.sampled_from(world.attempts)))
            world.look()


def test_the_property_is_not_empty():
    world = World()
    world.sign(OURS, "drone1", Action.HOLD, world.look())
    world.send(world.attempts[0])
    world.send(world.attempts[0])
    assert world.accepted == ["c0"]
    assert len(world.answers) == 1
