"""Every command, however it is ended, takes along all that it started.

``DFVS_ENDINGS=100`` ends every command so many times, in one way after the other; without it each
command is ended in two of the ways, and the next one in the two after these.
"""

import contextlib
import itertools
import os
import signal
import socket
import tempfile
from pathlib import Path

import numpy as np
import pytest
from loopback import free_endpoint, free_tcp_port, listening_peer
from recorded_flight import fly, write_recording
from started_commands import Command, Started, zenoh_words
from textured_wall import texture

from dfvs_core.messages.image import encode_png
from dfvs_sim.demo.flight.ports import any_port

ENDINGS = ("SIGTERM", "SIGINT", "SIGHUP", "SIGKILL", "parent")
COUNT = int(os.environ.get("DFVS_ENDINGS", 2))


def free_udp():
    return f"udpin://127.0.0.1:{any_port(socket.SOCK_DGRAM)}"


@pytest.fixture(scope="module")
def data(tmp_path_factory):
    """Goal picture and recording."""
    folder = tmp_path_factory.mktemp("data")
    rng = np.random.default_rng(3)
    (folder / "goal.png").write_bytes(encode_png(texture(rng)[:240, :320].astype(np.uint8)))
    write_recording(folder, fly(rng, frames=24).events)
    return folder


@pytest.fixture
def short_path():
    """A folder for Unix sockets, whose names have to be short."""
    with tempfile.TemporaryDirectory(prefix="dfvs-") as folder:
        yield Path(folder)


@pytest.fixture(scope="module")
def endpoint():
    """Where a service would listen."""
    with listening_peer() as (_, endpoint):
        yield endpoint


def service(data, _endpoint, *words, runs="dfvs_service.gate"):
    own = ("--camera-fov", "60", "--model", "classical", "--mavlink", free_udp())
    goal = ("--goal", str(data / "goal.png"))
    words = (*goal, *own, *zenoh_words(free_endpoint()), *words)
    return Command(("dfvs_service.cli", *words), runs=runs)


def beside(module, says="", *words):
    """Make a command that needs nothing but the service's Zenoh endpoint."""
    return lambda _, endpoint: Command((module, *words, *zenoh_words(endpoint)), says)


COMMANDS = {
    "service": lambda d, e: service(d, e, "--record", "recordings", runs="dfvs_service.flights"),
    "service --check": lambda d, e: service(d, e, "--check", "--check-timeout", "60"),
    "demo": lambda _, e: Command(("dfvs_sim.demo.cli", "--size", "192x144"), "takes off"),
    "demo --vehicles": lambda _, e: Command(
        ("dfvs_sim.demo.cli", "--vehicles", "2", "--size", "192x144"), "takes off"
    ),
    "sim": lambda _, e: Command(("dfvs_sim.cli",), "waiting for a vehicle", "camera"),
    "sim pilot": lambda _, e: Command(
        ("dfvs_sim.cli", "pilot", "--mavlink", free_udp()), "waiting for a vehicle"
    ),
    "sim fuzz": lambda _, e: Command(
        ("dfvs_robustness.cli", "fuzz", "gate", "--events", "9999999", "--workers", "2"),
        runs="spawn_main",
    ),
    "camera": lambda d, e: Command(
        ("dfvs_service.camera.cli", "--source", str(d / "goal.png"), "--loop", "--connect", e),
        "publishing on",
    ),
    "dashboard": lambda _, e: Command(
        ("dfvs_service.dashboard.cli", "--connect", e, "--port", str(free_tcp_port())),
        "dashboard at",
    ),
    "record": beside("dfvs_service.record.cli", "recording", "--out", "recordings"),
    "foxglove": beside("dfvs_service.live.foxglove_cli", "serving", "--port", "0"),
    "metrics": beside("dfvs_service.live.metrics_cli", "serving", "--port", "0"),
    "ros2": beside("dfvs_service.ros2.cli", "publishing"),
    "replay": lambda d, e: Command(
        ("dfvs_service.replay.cli", str(d / "flight-000.mcap"), "--bundle", "dfvs-flow"),
        loads="onnxruntime",
    ),
    "bench": lambda _, e: Command(
        ("dfvs_bench.cli", "lockstep", "--seeds", "1-100", "--workers", "2"), runs="spawn_main"
    ),
    "export": lambda _, e: Command(
        ("dfvs_export.cli", "bench", "dfvs-flow", "--runs", "9999"), runs="spawn_main"
    ),
}


FIXED_PORTS = ("sim",)
"""Commands of which only one can run at a time."""


@pytest.mark.slow
@pytest.mark.parametrize("name", COMMANDS)
def test_nothing_is_left_of_a_command_that_was_ended(name, data, endpoint, short_path):
    first = list(COMMANDS).index(name) * COUNT
    ways = list(itertools.islice(itertools.cycle(ENDINGS), first, first + COUNT))
    at_once = 1 if name in FIXED_PORTS else 2
    for k in range(0, COUNT, at_once):
        with contextlib.ExitStack() as stack:
            batch = []
            for how in ways[k : k + at_once]:
                started = Started(COMMANDS[name](data, endpoint), short_path / f"{k}-{how}")
                stack.callback(started.close)
                batch.append((how, started))
            for _, started in batch:
                started.await_work()
            for how, started in batch:
                code = started.end(how)
                if (name, how) == ("demo", "SIGTERM"):
                    assert code == 128 + signal.SIGTERM
                assert not started.left_ports(), how
                assert how == "SIGKILL" or not started.left_files(), how
                # A worker that is ended in the middle of its start may complain.
                is_plain = "spawn_main" not in started.command.runs
                assert not (is_plain and "Traceback" in started.output), (how, started.output)
