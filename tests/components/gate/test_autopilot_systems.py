"""MAVLink system ids of a link: the autopilot that is commanded, and others on the same link."""

import contextlib
import queue
import re
import socket
import subprocess
import sys
import threading
import time
from collections.abc import Callable, Iterator

import pytest
from pymavlink.dialects.v20 import development as mavlink
from vehicle_process import free_port
from watching import watched_autopilot

from dfvs_core.gate.events import AmbiguousLink, ForeignSetpoint, VehicleEvent
from dfvs_core.gate.limits import BodyVelocity
from dfvs_service.gate.autopilot import Autopilot
from dfvs_service.gate.mavlink_systems import VehicleError

pytestmark = pytest.mark.real_time

PATIENCE_S = 30.0
_LISTEN = """
import os, sys
from dfvs_service.route.vehicle_state import VehicleStateListener
url, patience_s, system_id = sys.argv[1:]
try:
    VehicleStateListener().connect(url, float(patience_s), int(system_id))
except Exception as error:
    print(repr(error), error, file=sys.stderr, flush=True)
os._exit(0)
"""
GROUND_STATION = mavlink.MAVLink_heartbeat_message(6, 8, 0, 0, 4, 3)
MULTIROTOR = mavlink.MAVLink_heartbeat_message(2, 12, 129, 4 << 16 | 3 << 24, 4, 3)


@pytest.fixture(autouse=True)
def _no_log_callback(monkeypatch):
    """MAVSDK frees a callback that is replaced, which another connection may be in."""
    monkeypatch.setattr("dfvs_service.gate.autopilot.log_subscribe", lambda _callback: None)


class Senders:
    """Programs that send to one port of this machine, ten times a second, and what they receive."""

    def __init__(self, port: int) -> None:
        self._port = port
        self._stop = threading.Event()
        self._threads: list[threading.Thread] = []

    def add(
        self, system: int, component: int, *messages: mavlink.MAVLink_message
    ) -> "queue.Queue[mavlink.MAVLink_message]":
        received: queue.Queue[mavlink.MAVLink_message] = queue.Queue()
        thread = threading.Thread(target=self._run, args=(system, component, messages, received))
        self._threads.append(thread)
        thread.start()
        return received

    def close(self) -> None:
        self._stop.set()
        for thread in self._threads:
            thread.join()

    def _run(self, system, component, messages, received) -> None:
        packer, parser = mavlink.MAVLink(None, system, component), mavlink.MAVLink(None)
        parser.robust_parsing = True
        with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as sock:
            sock.settimeout(0.1)
            while not self._stop.is_set():
                for message in messages:
                    sock.sendto(message.pack(packer), ("127.0.0.1", self._port))
                with contextlib.suppress(TimeoutError):
                    for message in parser.parse_buffer(sock.recv(65535)) or ():
                        received.put(message)


@contextlib.contextmanager
def link() -> Iterator[tuple[Senders, str]]:
    port = free_port()
    with contextlib.closing(Senders(port)) as senders:
        yield senders, f"udpin://127.0.0.1:{port}"


@contextlib.contextmanager
def connected(
    url: str, system_id: int = 0
) -> Iterator[tuple[Autopilot, "queue.Queue[VehicleEvent]"]]:
    """Connect and watch as the gate does."""
    events: queue.Queue[VehicleEvent] = queue.Queue()
    autopilot = Autopilot(events.put, lambda _kind, _text: None, system_id=system_id)
    autopilot.connect(url, PATIENCE_S)
    with watched_autopilot(autopilot, print):
        yield autopilot, events


def setpoint(target_system: int) -> mavlink.MAVLink_message:
    zeros = (0.0,) * 3
    return mavlink.MAVLink_set_position_target_local_ned_message(
        0, target_system, 1, 8, 0x5C7, *zeros, 0.3, 0.0, 0.0, *zeros, 0.0, 0.0
    )


def await_item(items: queue.Queue, fits: Callable[[object], bool]):
    deadline_s = time.monotonic() + PATIENCE_S
    while True:
        item = items.get(timeout=max(deadline_s - time.monotonic(), 0.01))
        if fits(item):
            return item


@pytest.mark.parametrize("system_id", [0, 2])
@pytest.mark.parametrize("sender", [(245, 191), (2, 196)])
def test_setpoints_for_an_autopilot_of_another_system_id_than_1_are_heard(sender, system_id):
    with link() as (senders, url):
        senders.add(2, 1, MULTIROTOR)
        senders.add(*sender, GROUND_STATION, setpoint(2))
        with connected(url, system_id) as (_, events):
            foreign = await_item(events, lambda event: isinstance(event, ForeignSetpoint))
        assert "system {}, component {}".format(*sender) in foreign.detail


def test_several_autopilots_on_a_link_are_reported_with_their_ids():
    with link() as (senders, url):
        senders.add(255, 190, GROUND_STATION)
        senders.add(7, 1, MULTIROTOR)
        senders.add(3, 1, MULTIROTOR)
        with connected(url) as (_, events):
            ambiguity = await_item(events, lambda event: isinstance(event, AmbiguousLink))
        assert "systems 3 and 7" in ambiguity.detail
        assert "255" not in ambiguity.detail


def test_goals_are_taken_by_none_of_several_autopilots_unless_it_is_named():
    assert re.search(r"VehicleError.*systems 3 and 7.*vehicle\.system_id", listened(0))
    assert "VehicleError" not in listened(3)


def listened(system_id):
    """Errors of a process that listens as those who take a goal do, to two autopilots."""
    with link() as (senders, url):
        senders.add(7, 1, MULTIROTOR)
        senders.add(3, 1, MULTIROTOR)
        words = (url, str(PATIENCE_S), str(system_id))
        done = subprocess.run((sys.executable, "-c", _LISTEN, *words), capture_output=True)
    return done.stderr.decode()


def test_the_autopilot_that_the_settings_name_is_commanded_and_no_other():
    with link() as (senders, url):
        first = senders.add(7, 1, MULTIROTOR)
        ours = senders.add(3, 1, MULTIROTOR)
        with connected(url, system_id=3) as (autopilot, events):
            for _ in range(20):
                autopilot.send_velocity(BodyVelocity(0.1))
                time.sleep(0.05)
        received = await_item(ours, lambda m: m.get_type() == "SET_POSITION_TARGET_LOCAL_NED")
        assert received.target_system == 3
        setpoints = [m for m in list(first.queue) if m.get_type() == received.get_type()]
        assert {m.target_system for m in setpoints} <= {3}
        assert not [event for event in list(events.queue) if isinstance(event, AmbiguousLink)]


def test_an_autopilot_that_is_not_there_is_told_with_those_that_are():
    with link() as (senders, url):
        senders.add(7, 1, MULTIROTOR)
        autopilot = Autopilot(lambda _event: None, lambda *_: None, system_id=3)
        with pytest.raises(VehicleError, match=r"no system 3 heard .* but system 7.*MAV_SYS_ID"):
            autopilot.connect(url, 1.5)
