"""Ports that are taken, by real sockets, and what the user reads of them."""

import contextlib
import re
import socket
import tomllib

import pytest
from loopback import free_tcp_port

from dfvs_core.errors import ConfigError
from dfvs_service.ports import (
    LocalPort,
    mavlink_port,
    require_free_mavlink_port,
    require_free_zenoh_ports,
    zenoh_port,
)
from dfvs_service.settings.sections import ZenohSection

TCP, UDP = socket.SOCK_STREAM, socket.SOCK_DGRAM


@contextlib.contextmanager
def bound(kind, port=0, *, shares=False):
    """Socket of another program; its port."""
    with socket.socket(socket.AF_INET, kind) as other:
        if shares:
            other.setsockopt(socket.SOL_SOCKET, socket.SO_REUSEADDR, 1)
        other.bind(("127.0.0.1", port))
        if kind is TCP:
            other.listen()
        yield other.getsockname()[1]


@pytest.mark.parametrize(
    ("endpoint", "port"),
    [
        ("tcp/127.0.0.1:7447", LocalPort(TCP, "127.0.0.1", 7447)),
        ("tls/0.0.0.0:7447", LocalPort(TCP, "0.0.0.0", 7447)),
        ("tcp/[::1]:7447", LocalPort(TCP, "::1", 7447)),
        ("tcp/localhost:7447#iface=lo", LocalPort(TCP, "localhost", 7447)),
        ("udp/127.0.0.1:7447?rel=0", LocalPort(UDP, "127.0.0.1", 7447)),
        ("quic/10.0.0.1:1", LocalPort(UDP, "10.0.0.1", 1)),
        ("tcp/127.0.0.1:0", None),
        ("tcp/127.0.0.1:65536", None),
        ("tcp/127.0.0.1", None),
        ("unixsock-stream//tmp/socket", None),
        ("", None),
    ],
)
def test_the_port_of_a_zenoh_endpoint(endpoint, port):
    assert zenoh_port(endpoint) == port


@pytest.mark.parametrize(
    ("url", "port"),
    [
        ("udpin://127.0.0.1:14540", LocalPort(UDP, "127.0.0.1", 14540)),
        ("udpin://0.0.0.0:14540", LocalPort(UDP, "0.0.0.0", 14540)),
        ("udp://:14540", LocalPort(UDP, "0.0.0.0", 14540)),
        ("udp://0.0.0.0:14540", LocalPort(UDP, "0.0.0.0", 14540)),
        ("udp://127.0.0.1:14540", None),
        ("udpout://127.0.0.1:14540", None),
        ("tcpin://127.0.0.1:5760", LocalPort(TCP, "127.0.0.1", 5760)),
        ("tcpout://127.0.0.1:5760", None),
        ("serial:///dev/ttyACM0:921600", None),
    ],
)
def test_the_port_at_which_mavsdk_listens(url, port):
    assert mavlink_port(url) == port


@pytest.mark.parametrize("kind", [TCP, UDP])
@pytest.mark.parametrize("shares", [True, False])
def test_a_port_of_another_program_is_taken_though_that_one_would_share_it(kind, shares):
    with bound(kind, shares=shares) as number:
        port = LocalPort(kind, "127.0.0.1", number)
        assert port.is_in_use()
        assert LocalPort(kind, "localhost", number).is_in_use()
        assert LocalPort(kind, "0.0.0.0", number).is_in_use()
        other = UDP if kind is TCP else TCP
        assert not LocalPort(other, "127.0.0.1", number).is_in_use()
    assert not port.is_in_use()


def test_a_port_of_a_connection_that_was_closed_is_free():
    """A service that is started again at once finds its port in TIME_WAIT."""
    with socket.create_server(("127.0.0.1", 0)) as server:
        number = server.getsockname()[1]
        with socket.create_connection(("127.0.0.1", number)):
            accepted, _ = server.accept()
            accepted.close()  # the end that closes first waits
    assert not LocalPort(TCP, "127.0.0.1", number).is_in_use()


@pytest.mark.parametrize("host", ["192.0.2.1", "no-such-host.invalid", ".."])
def test_an_address_that_cannot_be_bound_is_left_to_those_who_bind_it(host):
    assert not LocalPort(TCP, host, free_tcp_port()).is_in_use()


def test_a_loopback_port_is_unheard_while_nobody_listens():
    port = LocalPort(TCP, "127.0.0.1", free_tcp_port())
    assert port.is_unheard()
    with socket.create_server(("127.0.0.1", port.port)):
        assert not port.is_unheard()


@pytest.mark.parametrize(("kind", "host"), [(TCP, "192.0.2.1"), (UDP, "127.0.0.1")])
def test_of_other_ports_it_is_not_known_whether_anybody_listens(kind, host):
    assert not LocalPort(kind, host, free_tcp_port()).is_unheard()


def test_the_next_free_port_leaves_out_those_that_are_taken():
    with bound(UDP) as first, contextlib.suppress(OSError), bound(UDP, port=first + 1):
        found = LocalPort(UDP, "127.0.0.1", first).next_free()
        assert found > first + 1
        assert not LocalPort(UDP, "127.0.0.1", found).is_in_use()


def test_after_the_last_port_any_free_one_is_found():
    found = LocalPort(TCP, "127.0.0.1", 65535).next_free()
    assert not LocalPort(TCP, "127.0.0.1", found).is_in_use()


def test_a_taken_zenoh_port_comes_with_a_setting_that_works():
    free = free_tcp_port()
    with bound(TCP) as number:
        listen = (f"tcp/127.0.0.1:{free}", f"tcp/127.0.0.1:{number}")
        with pytest.raises(ConfigError, match=f"TCP port {number} is taken") as refused:
            require_free_zenoh_ports(ZenohSection(listen=listen))
        assert len(str(refused.value).splitlines()) == 1
        setting = re.search(r"--set 'zenoh\.(.*?)'", refused.value.remedy).group(1)
        proposed = tomllib.loads(setting)["listen"]
        assert proposed[0] == listen[0]
        assert not zenoh_port(proposed[1]).is_in_use()
        require_free_zenoh_ports(ZenohSection(listen=tuple(proposed)))


def test_a_client_of_a_router_listens_on_nothing():
    with bound(TCP) as number:
        place = (f"tcp/127.0.0.1:{number}",)
        require_free_zenoh_ports(ZenohSection("client", place, place))


def test_a_taken_mavlink_port_comes_with_a_connection_that_works():
    with bound(UDP, shares=True) as number:
        with pytest.raises(ConfigError, match=f"UDP port {number} is taken") as refused:
            require_free_mavlink_port(f"udpin://127.0.0.1:{number}")
        proposed = refused.value.remedy.rsplit("--mavlink ", 1)[1]
        assert proposed.startswith("udpin://127.0.0.1:")
        require_free_mavlink_port(proposed)
    require_free_mavlink_port(f"udpin://127.0.0.1:{number}")
