"""The vehicle's UDP links."""

import select
from contextlib import closing

import pytest
from vehicle_in_hand import gcs_heartbeat

from dfvs_core.errors import ConfigError
from dfvs_sim.vehicle.messages.udp_link import UdpLink, UdpPorts


def arrived(link: UdpLink) -> list[str]:
    select.select([link.socket], [], [], 1.0)
    return [m.get_type() for m in link.receive()]


def test_a_taken_port_is_an_error_that_says_what_to_do() -> None:
    with (
        closing(UdpLink("companion", UdpPorts(0, 9))) as first,
        pytest.raises(ConfigError, match=rf"{first.port} for the companion link is taken"),
    ):
        UdpLink("companion", UdpPorts(first.port, 9))


def test_it_speaks_to_the_expected_port_until_somebody_else_speaks_first() -> None:
    with (
        closing(UdpLink("expected", UdpPorts(0, 9))) as expected,
        closing(UdpLink("other", UdpPorts(0, 9))) as other,
        closing(UdpLink("vehicle", UdpPorts(0, expected.port))) as vehicle,
    ):
        vehicle.send(gcs_heartbeat())
        assert arrived(expected) == ["HEARTBEAT"]
        other.socket.sendto(gcs_heartbeat().pack(other._packer), ("127.0.0.1", vehicle.port))
        assert arrived(vehicle) == ["HEARTBEAT"]
        vehicle.send(gcs_heartbeat())
        assert arrived(other) == ["HEARTBEAT"]


def test_sending_to_nobody_is_no_error() -> None:
    with closing(UdpLink("gone", UdpPorts(0, 9))) as gone:
        port = gone.port
    with closing(UdpLink("vehicle", UdpPorts(0, port))) as vehicle:
        for _ in range(10):
            vehicle.send(gcs_heartbeat())
            vehicle.receive()
