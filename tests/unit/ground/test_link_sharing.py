"""Several ground stations on one autopilot's port."""

import socket
from collections.abc import Iterator

import pytest
from pymavlink.dialects.v20 import development as mavlink
from waiting import until

from dfvs_core.errors import ConfigError
from dfvs_sim.ground.link import GroundLink
from dfvs_sim.ground.sharing import LinkSharing

HEARTBEAT = mavlink.MAVLink_heartbeat_message(
    mavlink.MAV_TYPE_QUADROTOR, mavlink.MAV_AUTOPILOT_PX4, 0, 0, 3, 3
)


@pytest.fixture
def autopilot() -> Iterator[socket.socket]:
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as sock:
        sock.bind(("127.0.0.1", 0))
        sock.settimeout(2.0)
        yield sock


@pytest.fixture
def owner() -> Iterator[GroundLink]:
    with GroundLink("udpin://127.0.0.1:0") as link:
        yield link


def beat(autopilot: socket.socket, owner: GroundLink) -> None:
    data = HEARTBEAT.pack(mavlink.MAVLink(None, 7, mavlink.MAV_COMP_ID_AUTOPILOT1))
    autopilot.sendto(data, ("127.0.0.1", owner.port))


def test_two_more_ground_stations_hear_the_vehicle_and_are_heard_by_it(
    autopilot: socket.socket, owner: GroundLink
) -> None:
    beat(autopilot, owner)
    owner.wait_for_vehicle(20.0)
    with LinkSharing(owner, 0) as sharing:
        url = f"udpout://127.0.0.1:{sharing.port}"
        with GroundLink(url) as first, GroundLink(url) as second:

            def all_hear() -> bool:
                beat(autopilot, owner)
                return first.target == second.target == 7

            assert until(all_hear, 30.0)
            second.send(mavlink.MAVLink_manual_control_message(7, 0, 0, 500, 0, 0))
            parser = mavlink.MAVLink(None)
            names: list[str] = []
            while "MANUAL_CONTROL" not in names:  # ends by the socket's timeout at the latest
                names += [m.get_type() for m in parser.parse_buffer(autopilot.recv(4096)) or ()]


def test_a_ground_station_that_ended_does_not_disturb_the_others(
    autopilot: socket.socket, owner: GroundLink
) -> None:
    beat(autopilot, owner)
    owner.wait_for_vehicle(20.0)
    with LinkSharing(owner, 0) as sharing:
        url = f"udpout://127.0.0.1:{sharing.port}"
        with GroundLink(url) as first:
            assert until(lambda: beat(autopilot, owner) or first.target == 7, 30.0)
        beat(autopilot, owner)  # to a closed port
        with GroundLink(url) as second:
            assert until(lambda: beat(autopilot, owner) or second.target == 7, 30.0)


def test_a_taken_port_is_an_error_that_names_it(owner: GroundLink) -> None:
    with (
        LinkSharing(owner, 0) as sharing,
        pytest.raises(ConfigError, match=f"127.0.0.1:{sharing.port}"),
    ):
        LinkSharing(owner, sharing.port)
