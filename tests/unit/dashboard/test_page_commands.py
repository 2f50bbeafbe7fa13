import asyncio
import json
import threading
from concurrent.futures import ThreadPoolExecutor

import pytest

from dfvs_core.gate.commands.authority import Authority
from dfvs_core.gate.commands.command import Command, encode_command
from dfvs_core.gate.events import Action
from dfvs_service.command import UnansweredError
from dfvs_service.dashboard import client_session
from dfvs_service.dashboard.client_session import AppContext, ClientSession
from dfvs_service.dashboard.command_queue import CommandQueue
from dfvs_service.dashboard.hub import Hub
from dfvs_service.dashboard.tokens import Tokens
from dfvs_service.dashboard.vehicles.clock import Moment
from dfvs_service.settings.sections import ZenohSection

KEY = b"k" * 32
ALL = 200
"""More commands than any page may have under way."""


class SilentQueue:
    """Answers no command before it is released, but those of ``quick``."""

    def __init__(self, quick):
        self.quick = quick
        self.released = threading.Event()

    def give(self, _vehicle, word, _goal):
        if word not in self.quick:
            self.released.wait(10.0)
        return True, f"accepted: {word}"


class Socket:
    """A browser that signs in, sends commands, and stays until it is told to go."""

    def __init__(self, commands):
        hello = {"type": "hello", "token": "t" * 20}
        self.messages = [hello, *({"type": "command", **command} for command in commands)]
        self.answers = []
        self.answered = asyncio.Event()
        self.wanted = 1

    async def accept(self):
        pass

    async def receive(self):
        if self.messages:
            return {"type": "websocket.receive", "text": json.dumps(self.messages.pop(0))}
        await self.answered.wait()
        return {"type": "websocket.disconnect"}

    async def send_text(self, text):
        self.answers += json.loads(text).get("answers", [])
        if len(self.answers) >= self.wanted:
            self.answered.set()


def context(queue):
    """What sessions share, with a token for operators."""
    hub = Hub(lambda: Moment(0, 0.0), lambda _: None)
    return AppContext(hub, Tokens(operator=b"t" * 20), queue, lambda: Moment(0, 0.0))


def answers(*commands, wanted=1, quick=()):
    """The first ``wanted`` answers to commands, of which only those of ``quick`` get the gate's."""

    async def serve():
        asyncio.get_running_loop().set_default_executor(ThreadPoolExecutor(1))
        queue, socket = SilentQueue(quick), Socket(commands)
        socket.wanted = wanted
        try:
            await asyncio.wait_for(ClientSession(socket, context(queue)).serve(), 5.0)
        finally:
            queue.released.set()
        return socket.answers

    return asyncio.run(serve())


def refused(*commands, wanted=1):
    """Those of the commands that are refused while the gate answers none; ``wanted`` of them."""
    refusals = answers(*commands, wanted=wanted)
    assert not any(answer["accepted"] for answer in refusals)
    return [(answer["vehicle"], answer["command"]) for answer in refusals]


def command(word, vehicle="swift"):
    return {"command": word, "vehicle": vehicle}


@pytest.mark.parametrize("word", ["hold", "abort"])
def test_a_stop_is_sent_though_earlier_commands_are_not_answered_yet(word):
    other = "hold" if word == "abort" else "abort"
    earlier = [command("engage"), command("engage"), command(other), command(other)]
    assert refused(*earlier, command(word), command("engage")) == [("swift", "engage")]


def test_a_stop_for_another_vehicle_is_sent_though_earlier_ones_are_not_answered_yet():
    earlier = [command("abort"), command("abort")]
    commands = [*earlier, command("abort", "heron"), command("abort")]
    assert refused(*commands) == [("swift", "abort")]


def test_a_stop_is_not_held_up_by_commands_that_wait_for_their_answers():
    (answer,) = answers(command("engage"), command("abort"), quick=("abort",))
    assert answer["text"] == "accepted: abort"


def test_a_page_cannot_flood_the_server_with_stops():
    commands = [command("abort", f"v{i}") for i in range(ALL)]
    assert len(refused(*commands, wanted=ALL - 32)) >= ALL - 32


class SilentSocket:
    """A browser that never greets."""

    async def accept(self):
        pass

    async def receive(self):
        await asyncio.Event().wait()

    async def close(self, code, reason):
        self.closed = code, reason


def test_a_page_that_is_too_slow_to_greet_is_not_told_that_its_token_is_wrong(monkeypatch):
    monkeypatch.setattr(client_session, "HELLO_TIMEOUT_S", 0.01)
    socket = SilentSocket()
    asyncio.run(ClientSession(socket, context(None)).serve())
    assert socket.closed == (4408, "no greeting came")


def queue_at(authority, actions):
    """A queue whose sender finds its challenge used by the next one of ``actions``."""

    def send(config, key, action, _timeout_s, _goal):
        challenge = authority.challenge(0)
        if actions:
            other = Command(config.vehicle.name, actions.pop(0), challenge, "0" * 32)
            authority.evaluate(encode_command(key, other), 0)
        sent = Command(config.vehicle.name, action, challenge, f"{len(actions)}" * 32)
        return authority.evaluate(encode_command(key, sent), 0).text

    return CommandQueue(KEY, lambda _: ZenohSection(), send)


def authority():
    challenges = iter(f"c{i}" for i in range(9))
    return Authority(KEY, "swift", lambda: next(challenges), 0)


@pytest.mark.parametrize("word", ["hold", "abort"])
def test_a_stop_whose_challenge_another_command_used_is_sent_once_more(word):
    queue = queue_at(authority(), [Action.ENGAGE])
    assert queue.give("swift", word, None) == (True, f"accepted: {word}")


def test_a_stop_is_sent_twice_at_most():
    queue = queue_at(authority(), [Action.ENGAGE] * 2)
    accepted, text = queue.give("swift", "abort", None)
    assert not accepted
    assert "challenge" in text


def test_a_command_that_was_sent_and_not_answered_is_not_called_unsent():
    def send(*_):
        raise UnansweredError("the service did not answer")

    accepted, text = CommandQueue(KEY, lambda _: ZenohSection(), send).give("swift", "engage", None)
    assert not accepted
    assert text.startswith("not answered: ")


def test_an_engagement_whose_challenge_another_command_used_is_not_sent_again():
    queue = queue_at(authority(), [Action.HOLD])
    assert queue.give("swift", "engage", None)[0] is False
