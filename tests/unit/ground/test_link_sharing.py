"""Several ground stations on one autopilot's port."""

from collections.abc import Iterator

import pytest
from autopilot_socket import Autopilot
from pymavlink.dialects.v20 import development as mavlink
from waiting import until

from dfvs_core.errors import ConfigError
from dfvs_sim.ground.link import GroundLink
from dfvs_sim.ground.sharing import LinkSharing


@pytest.fixture
def sharing(link: GroundLink, autopilot: Autopilot) -> Iterator[LinkSharing]:
    """The shared link to the autopilot."""
    autopilot.beat()
    link.wait_for_vehicle(20.0)
    with LinkSharing(link, 0) as sharing:
        yield sharing


def test_two_more_ground_stations_hear_the_vehicle_and_are_heard_by_it(
    autopilot: Autopilot, sharing: LinkSharing
) -> None:
    url = f"udpout://127.0.0.1:{sharing.port}"
    with GroundLink(url) as first, GroundLink(url) as second:

        def all_hear() -> bool:
            autopilot.beat()
            return first.target == second.target == 7

        assert until(all_hear, 30.0)
        second.send(mavlink.MAVLink_manual_control_message(7, 0, 0, 500, 0, 0))
        parser = mavlink.MAVLink(None)
        names: list[str] = []
        while "MANUAL_CONTROL" not in names:  # ends by the socket's timeout at the latest
            data = autopilot.socket.recv(4096)
            names += [m.get_type() for m in parser.parse_buffer(data) or ()]


def test_a_ground_station_that_ended_does_not_disturb_the_others(
    autopilot: Autopilot, sharing: LinkSharing
) -> None:
    url = f"udpout://127.0.0.1:{sharing.port}"
    with GroundLink(url) as first:
        assert until(lambda: autopilot.beat() or first.target == 7, 30.0)
    autopilot.beat()  # to a closed port
    with GroundLink(url) as second:
        assert until(lambda: autopilot.beat() or second.target == 7, 30.0)


def test_a_taken_port_is_an_error_that_names_it(link: GroundLink) -> None:
    with (
        LinkSharing(link, 0) as sharing,
        pytest.raises(ConfigError, match=f"127.0.0.1:{sharing.port}"),
    ):
        LinkSharing(link, sharing.port)
