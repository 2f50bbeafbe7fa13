"""State and commands over real Zenoh, while perception is stopped."""

import contextlib
import json
import queue
import signal
import time

import pytest
from gate_flight import service_running
from loopback import free_endpoint

from dfvs_core.messages.topics import Topics
from dfvs_service import cli
from dfvs_service.command import operators_zenoh
from dfvs_service.settings.config import load_config
from dfvs_service.zenoh_session import open_session

pytestmark = pytest.mark.real_time

S = 1_000_000_000
TOPICS = Topics("drone1")


@contextlib.contextmanager
def states_of(endpoint):
    """States as they arrive: (monotonic time of arrival in ns, document)."""
    heard = queue.Queue()
    config = load_config(None, {"zenoh.listen": [endpoint]}).zenoh

    def on_state(sample):
        heard.put((time.monotonic_ns(), json.loads(sample.payload.to_bytes())))

    with open_session(operators_zenoh(config)) as session:
        subscriber = session.declare_subscriber(TOPICS.telemetry("state"), on_state)
        yield heard
        subscriber.undeclare()


def order(endpoint, key_file, action):
    """Exit code of the command, and how long it took in s."""
    start = time.monotonic()
    options = ["--key-file", str(key_file), "--set", f"zenoh.listen=['{endpoint}']"]
    return cli.main(["command", action, *options]), time.monotonic() - start


def drained(heard):
    while not heard.empty():
        heard.get()
    return heard


def test_a_stopped_perception_holds_up_neither_the_state_nor_a_command(
    vehicle, key_file, tmp_path, capsys
):
    endpoint = free_endpoint()
    settings = {"zenoh__listen": [endpoint], "gate__command_key_file": str(key_file)}
    with service_running(
        vehicle, tmp_path / "runtime", gate__exit_when_done=False, gate__hold_s=10.0, **settings
    ) as flight:
        flight.until("SERVO")
        with states_of(endpoint) as heard:
            heard.get(timeout=30.0)
            flight.signal("perception", signal.SIGSTOP)
            flight.until("HOLD")
            drained(heard)
            states = [heard.get(timeout=10.0) for _ in range(21)]
            rate_hz = 20 * S / (states[-1][0] - states[0][0])
            assert 5.0 < rate_hz < 11.0
            assert {document["state"] for _, document in states} <= {"HOLD"}
            # A state is of the moment in which it arrives: nothing waits on the way.
            assert max(t_ns - document["t_ns"] for t_ns, document in states) < S
            for action in ("hold", "abort"):
                code, took_s = order(endpoint, key_file, action)
                assert code == 0
                assert took_s < 5.0  # most of it opens a session and waits for a challenge
        flight.signal("perception", signal.SIGCONT)
    assert capsys.readouterr().out.splitlines() == ["accepted: hold", "accepted: abort"]


def test_without_its_operator_link_a_flight_holds_and_then_ends(vehicle, tmp_path):
    settings = {"gate__exit_when_done": False, "gate__hold_s": 1.0}
    with service_running(vehicle, tmp_path / "runtime", **settings) as flight:
        flight.until("SERVO")
        flight.signal("operator_link", signal.SIGSTOP)
        flight.until("HOLD")
        assert flight.transitions()[-1]["cause"] == "watch lost"
        assert flight.transitions()[-1]["detail"].startswith("other services, last one 5.")
        flight.until("ABORT")
