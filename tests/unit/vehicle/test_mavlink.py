"""The vehicle's UDP links."""

import select

import pytest
from vehicle_in_hand import gcs_heartbeat

from dfvs_core.errors import ConfigError
from dfvs_sim.vehicle.messages.udp_link import UdpLink, UdpPorts


def arrived(link: UdpLink) -> list[str]:
    select.select([link.socket], [], [], 1.0)
    return [m.get_type() for m in link.receive()]


def test_a_taken_port_is_an_error_that_says_what_to_do() -> None:
    first = UdpLink("companion", UdpPorts(0, 9))
    try:
        with pytest.raises(ConfigError, match=rf"{first.port} for the companion link is taken"):
            UdpLink("companion", UdpPorts(first.port, 9))
    finally:
        first.close()


def test_it_speaks_to_the_expected_port_until_somebody_else_speaks_first() -> None:
    expected, other = UdpLink("expected", UdpPorts(0, 9)), UdpLink("other", UdpPorts(0, 9))
    vehicle = UdpLink("vehicle", UdpPorts(0, expected.port))
    try:
        vehicle.send(gcs_heartbeat())
        assert arrived(expected) == ["HEARTBEAT"]
        other.socket.sendto(gcs_heartbeat().pack(other._packer), ("127.0.0.1", vehicle.port))
        assert arrived(vehicle) == ["HEARTBEAT"]
        vehicle.send(gcs_heartbeat())
        assert arrived(other) == ["HEARTBEAT"]
    finally:
        for link in (expected, other, vehicle):
            link.close()


def test_sending_to_nobody_is_no_error() -> None:
    gone = UdpLink("gone", UdpPorts(0, 9))
    port = gone.port
    gone.close()
    vehicle = UdpLink("vehicle", UdpPorts(0, port))
    try:
        for _ in range(10):
            vehicle.send(gcs_heartbeat())
            vehicle.receive()
    finally:
        vehicle.close()
