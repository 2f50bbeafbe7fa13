"""How a camera reaches the service, with whatever protects the way."""

import pytest

from dfvs_core.errors import ConfigError
from dfvs_service.camera.options import cameras_zenoh
from dfvs_service.command import operators_zenoh
from dfvs_service.settings.sections import TlsFiles, ZenohSection

TLS = TlsFiles("ca.pem", "camera.pem", "camera-key.pem")


def test_it_connects_to_where_the_service_listens():
    made = cameras_zenoh(ZenohSection(), None)
    assert (made.mode, made.connect, made.listen) == ("peer", ("tcp/127.0.0.1:7447",), ())


def test_it_meets_the_service_at_its_router_with_its_own_certificate():
    service = ZenohSection("client", ("tls/10.0.0.1:7447",), (), tls=TLS)
    made = cameras_zenoh(service, None)
    assert (made.mode, made.connect, made.tls) == ("client", ("tls/10.0.0.1:7447",), TLS)


@pytest.mark.parametrize(
    "endpoints_of", [lambda zenoh: cameras_zenoh(zenoh, None), operators_zenoh]
)
@pytest.mark.parametrize(
    ("listen", "connect"),
    [
        ("tls/0.0.0.0:7447", "tls/127.0.0.1:7447"),
        ("tls/[::]:7447", "tls/localhost:7447"),
        ("tls/192.168.1.10:7447", "tls/192.168.1.10:7447"),
        ("tls/10.0.0.0:7447", "tls/10.0.0.0:7447"),
    ],
)
def test_who_listens_everywhere_is_met_at_an_address_of_its_certificate(
    listen, connect, endpoints_of
):
    assert endpoints_of(ZenohSection(listen=(listen,), tls=TLS)).connect == (connect,)


def test_a_named_endpoint_wins_and_must_be_safe():
    assert cameras_zenoh(ZenohSection(), "tcp/127.0.0.1:9").connect == ("tcp/127.0.0.1:9",)
    with pytest.raises(ConfigError, match="unencrypted"):
        cameras_zenoh(ZenohSection(), "tcp/10.0.0.1:7447")
