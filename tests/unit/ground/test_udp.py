"""Connection URLs of the ground station's link."""

import socket

import pytest

from dfvs_core.errors import ConfigError
from dfvs_sim.ground.udp import Endpoint


def test_both_spellings_of_a_url_are_read() -> None:
    expected = Endpoint(listens=True, host="127.0.0.1", port=14550)
    assert Endpoint.from_url("udpin://127.0.0.1:14550") == expected
    assert Endpoint.from_url("udpin:127.0.0.1:14550") == expected
    assert not Endpoint.from_url("udpout://127.0.0.1:18570").listens


@pytest.mark.parametrize("url", ["", "tcp://1.2.3.4:5", "udpin://host", "udpin://host:70000"])
def test_other_urls_are_refused_with_the_right_form(url: str) -> None:
    with pytest.raises(ConfigError, match="udpin://HOST:PORT"):
        Endpoint.from_url(url)


def test_a_taken_port_is_an_error_that_names_it() -> None:
    with Endpoint(listens=True, host="127.0.0.1", port=0).open() as first:
        port = first.getsockname()[1]
        with pytest.raises(ConfigError, match=f"127.0.0.1:{port}"):
            Endpoint(listens=True, host="127.0.0.1", port=port).open()


@pytest.mark.parametrize("error", [socket.gaierror(-2, "unknown"), UnicodeError()])
def test_a_host_that_is_not_found_is_an_error_that_names_it(
    error: Exception, monkeypatch: pytest.MonkeyPatch
) -> None:
    def getaddrinfo(*_: object, **__: object) -> None:
        raise error

    monkeypatch.setattr(socket, "getaddrinfo", getaddrinfo)
    with pytest.raises(ConfigError, match=r"no host 'a\.\.b'"):
        Endpoint(listens=False, host="a..b", port=18570).open()


def test_a_link_to_the_vehicle_sends_from_one_port_and_from_another_where_that_is_taken() -> None:
    """PX4 answers the first port that it hears from for good."""
    to_vehicle = Endpoint(listens=False, host="127.0.0.1", port=18570)
    with to_vehicle.open() as first:
        own = first.getsockname()[1]
        with to_vehicle.open() as second:
            assert second.getsockname()[1] not in (0, own)
    with to_vehicle.open() as again:
        assert again.getsockname()[1] == own
