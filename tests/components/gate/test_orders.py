"""``dfvs-service command`` over real Zenoh, against the gate's own judgement of orders."""

import json
import secrets
import threading
import time

import numpy as np
import pytest
from loopback import free_endpoint

from dfvs_core.gate.commands.authority import Authority
from dfvs_core.geometry.camera import CameraModel
from dfvs_core.messages.goal import GoalSidecar
from dfvs_core.messages.goal_command import GoalCommand
from dfvs_core.messages.image import encode_png
from dfvs_core.messages.topics import Topics
from dfvs_service import cli
from dfvs_service.goal_store import GoalStore
from dfvs_service.operator_link.command_filter import CommandFilter
from dfvs_service.settings.config import load_config
from dfvs_service.settings.goal_file import commanded_goal
from dfvs_service.settings.key_file import create_key, load_key
from dfvs_service.zenoh_session import open_session

TOPICS = Topics("swift")


class Service:
    """Publishes its state at 10 Hz and judges what arrives, as gate and operator link together."""

    def __init__(self, session, key, store):
        self.session = session
        self.store = store
        now_ns = time.monotonic_ns()
        self.authority = Authority(key, "swift", lambda: secrets.token_hex(8), now_ns)
        self.results = []
        self.stopped = threading.Event()
        self.desk = CommandFilter(store, now_ns)
        self.arguments = []
        self.lost = 0
        """So many commands get lost on the way."""
        self.mute = 0
        """So many answers get lost on the way back."""
        self.publisher = session.declare_publisher(TOPICS.telemetry("state"))
        self.subscriber = session.declare_subscriber(TOPICS.command, self.on_command)
        self.goals = session.declare_subscriber(TOPICS.new_goal, self.on_goal)
        self.thread = threading.Thread(target=self.publish)
        self.thread.start()

    def on_command(self, sample):
        self.judge(self.desk.receive_command(sample.payload.to_bytes(), time.monotonic_ns()))

    def on_goal(self, sample):
        signed = sample.attachment.to_bytes()
        self.judge(self.desk.receive_goal(sample.payload.to_bytes(), signed, time.monotonic_ns()))

    def judge(self, command):
        if self.lost > 0:
            self.lost -= 1
            return
        verdict = self.authority.evaluate(command.payload.encode(), time.monotonic_ns())
        if not verdict.is_repeated:
            self.arguments.append(verdict.argument)
            self.results.append(verdict.text)
        if self.mute > 0:
            self.mute -= 1
            return
        self.say({"request": "0" * 32, "result": "rejected: somebody else's"})
        self.say({"request": verdict.request, "result": verdict.text})

    def say(self, answer):
        self.session.put(TOPICS.telemetry("answer"), json.dumps(answer))

    def publish(self):
        while not self.stopped.wait(0.1):
            state = {
                "challenge": self.authority.challenge(time.monotonic_ns()),
                "command_result": "rejected: an older one",
                "command_count": len(self.results),
            }
            self.publisher.put(json.dumps(state))

    def stop(self):
        self.stopped.set()
        self.thread.join()


@pytest.fixture
def endpoint():
    return free_endpoint()


@pytest.fixture
def listening(endpoint, tmp_path):
    """Starts a service with a key, or with none."""
    services = []
    with open_session(load_config(None, {"zenoh.listen": [endpoint]}).zenoh) as session:

        def start(key):
            services.append(Service(session, key, GoalStore(tmp_path / "goals")))
            return services[-1]

        yield start
        for service in services:
            service.stop()


def order(endpoint, key_file, action, *words):
    options = ["--vehicle", "swift", "--set", f"zenoh.listen=['{endpoint}']", "--timeout", "2"]
    return cli.main(["command", action, "--key-file", str(key_file), *options, *words])


def test_orders_are_accepted_one_after_the_other(endpoint, key_file, listening, capsys):
    service = listening(load_key(key_file))
    assert order(endpoint, key_file, "engage") == 0
    assert order(endpoint, key_file, "abort") == 0
    assert service.results == ["accepted: engage", "accepted: abort"]
    assert capsys.readouterr().out.splitlines() == service.results


def test_an_order_that_got_lost_is_given_once_more(endpoint, key_file, listening, capsys):
    service = listening(load_key(key_file))
    service.lost = 1
    assert order(endpoint, key_file, "hold") == 0
    assert service.results == ["accepted: hold"]
    service.lost = 1000
    assert order(endpoint, key_file, "hold") == 2
    assert "did not answer in 2 s" in capsys.readouterr().err


def test_an_order_whose_answer_got_lost_is_obeyed_once_and_answered_again(
    endpoint, key_file, listening, capsys
):
    service = listening(load_key(key_file))
    service.mute = 2
    assert order(endpoint, key_file, "abort") == 0
    assert service.results == ["accepted: abort"]
    assert capsys.readouterr().out == "accepted: abort\n"


def test_a_new_goal_arrives_with_its_sidecar_under_one_signature(
    endpoint, key_file, listening, tmp_path
):
    service = listening(load_key(key_file))
    picture, sidecar = tmp_path / "b.png", GoalSidecar(CameraModel.from_horizontal_fov(64, 48, 1.0))
    picture.write_bytes(
        encode_png(np.random.default_rng(0).integers(0, 255, (48, 64, 3), np.uint8))
    )
    picture.with_suffix(".json").write_text(sidecar.to_json())
    assert order(endpoint, key_file, "goal", "--goal", str(picture)) == 0
    assert service.results == ["accepted: goal"]
    arrived = GoalCommand.from_bytes(service.store.pop(service.arguments[0]))
    assert arrived == GoalCommand(picture.read_bytes(), sidecar.to_json())
    assert commanded_goal(arrived, sidecar).sidecar == sidecar


def test_an_order_under_the_wrong_key_is_refused(endpoint, key_file, listening, tmp_path, capsys):
    service = listening(load_key(key_file))
    create_key(tmp_path / "other")
    assert order(endpoint, tmp_path / "other", "hold") == 1
    assert "gate.command_key_file" in service.results[0]
    assert service.results[0] in capsys.readouterr().out


def test_a_service_without_a_key_says_so(endpoint, key_file, listening, capsys):
    listening(None)
    assert order(endpoint, key_file, "hold") == 2
    assert "accepts no commands" in capsys.readouterr().err


def test_no_service_is_said_in_one_line(endpoint, key_file, refused):
    refused(lambda _: order(endpoint, key_file, "hold"))
