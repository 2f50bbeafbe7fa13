"""Both links of a flight lead to the same vehicle."""

import socket
import threading
from contextlib import AbstractContextManager

import pytest
from pymavlink.dialects.v20 import development as mavlink
from vehicle_process import free_port

from dfvs_sim.demo.flight.flight import running
from dfvs_sim.demo.flight.system_id import flown_system_id
from dfvs_sim.demo.options import FlightOptions
from dfvs_sim.ground.systems import LinkError


@pytest.fixture(autouse=True)
def quick_heartbeats(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("dfvs_sim.ground.systems.HEARTBEATS_S", 0.5)


def autopilots(port: int, *systems: int) -> AbstractContextManager[None]:
    """Heartbeats of these systems to a port, ten times a second."""

    def beat(stop: threading.Event) -> None:
        packers = [mavlink.MAVLink(None, number, 1) for number in systems]
        message = mavlink.MAVLink_heartbeat_message(2, 12, 0, 0, 3, 3)
        with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as sock:
            while not stop.wait(0.1):
                for packer in packers:
                    sock.sendto(message.pack(packer), ("127.0.0.1", port))

    return running(beat, "autopilots")


def options(port: int, system_id: int | None = None) -> FlightOptions:
    return FlightOptions(autopilot=f"udpin://127.0.0.1:{port}", system_id=system_id)


def test_the_simulated_vehicle_has_the_id_that_it_is_given() -> None:
    assert flown_system_id(FlightOptions(), 0.1) == 1
    assert flown_system_id(FlightOptions(system_id=4), 0.1) == 4


def test_the_vehicle_on_the_companion_link_is_flown_unless_another_is_asked_for() -> None:
    port = free_port()
    with autopilots(port, 5):
        assert flown_system_id(options(port), 5.0) == 5
        assert flown_system_id(options(port, system_id=5), 5.0) == 5
        with pytest.raises(LinkError, match=r"system 5 is on .*expected system 2"):
            flown_system_id(options(port, system_id=2), 5.0)


def test_two_vehicles_on_the_companion_link_are_refused_unless_one_is_named() -> None:
    port = free_port()
    with autopilots(port, 5, 6):
        with pytest.raises(LinkError, match=r"systems 5 and 6 .*--system-id"):
            flown_system_id(options(port), 5.0)
        with pytest.raises(LinkError, match=r"systems 5 and 6 are on .*expected system 2"):
            flown_system_id(options(port, system_id=2), 5.0)
        assert flown_system_id(options(port, system_id=6), 5.0) == 6


def test_a_silent_companion_link_is_refused() -> None:
    with pytest.raises(LinkError, match="no heartbeat"):
        flown_system_id(options(free_port()), 0.1)


def test_a_link_that_cannot_be_listened_on_takes_the_id_that_was_given() -> None:
    for given in (None, 3):
        serial = FlightOptions(autopilot="serial:///dev/ttyACM0:57600", system_id=given)
        assert flown_system_id(serial, 0.1) == given
