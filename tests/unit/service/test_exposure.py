import datetime

import pytest

from dfvs_core.errors import ConfigError
from dfvs_service.certificates.authority import Validity, make_authority, write_credentials
from dfvs_service.settings.config import load_config
from dfvs_service.settings.endpoints import is_private
from dfvs_service.settings.exposure import exposure_checks
from dfvs_service.zenoh_session import require_usable_files


@pytest.mark.parametrize(
    ("endpoint", "private"),
    [
        ("tcp/127.0.0.1:7447", True),
        ("tcp/127.8.9.10:7447", True),
        ("tcp/127.1.2.3:1", True),
        ("tcp/localhost:7447", True),
        ("tcp/[::1]:7447", True),
        ("udp/[::1]:7447?rel=0", True),
        ("unixsock-stream//run/zenoh", True),
        ("tls/10.0.0.1:7447", True),
        ("tls/drone.example:7447", True),
        ("quic/10.0.0.1:7447", True),
        ("quic/[fe80::1]:7447", True),
        ("tcp/0.0.0.0:7447", False),
        ("tcp/[::]:7447", False),
        ("tcp/192.168.1.2:7447", False),
        ("tcp/10.0.0.1:7447", False),
        ("udp/192.168.0.1:7447", False),
        ("tcp/127.0.0.1.evil.example:7447", False),
        ("tcp/localhost.evil.example:7447", False),
        ("ws/10.0.0.1:80", False),
        ("serial//dev/ttyUSB0", False),
        ("tcp/", False),
        ("", False),
    ],
)
def test_what_stays_on_this_machine_or_is_encrypted_is_private(endpoint, private):
    assert is_private(endpoint) is private


def assert_advises(check):
    assert not check.ok
    assert not check.refuses
    assert check.remedy


@pytest.mark.parametrize("endpoint", ["tcp/0.0.0.0:7447", "udp/192.168.0.1:7447", "tcp/"])
@pytest.mark.parametrize("key", ["zenoh.connect", "zenoh.listen"])
def test_plain_zenoh_beyond_this_machine_needs_a_loud_yes(key, endpoint):
    with pytest.raises(ConfigError, match="allow_plaintext"):
        load_config(None, {key: [endpoint]})
    config = load_config(None, {key: [endpoint], "zenoh.allow_plaintext": True})
    zenoh, mavlink = exposure_checks(config)
    assert f"{endpoint} NOT ENCRYPTED" in zenoh.detail
    assert_advises(zenoh)
    assert mavlink.ok


@pytest.mark.parametrize("endpoint", ["127.0.0.1:7447", ""])
@pytest.mark.parametrize("key", ["zenoh.connect", "zenoh.listen"])
def test_an_endpoint_needs_its_protocol(key, endpoint):
    with pytest.raises(ConfigError, match=f"'{endpoint}'; expected PROTOCOL/HOST:PORT"):
        load_config(None, {key: [endpoint]})


@pytest.mark.parametrize("connect", [[], ["tcp/127.0.0.1:7447"], ["tls/drone.example:7447"]])
def test_defaults_and_zenoh_on_this_machine_or_encrypted_expose_nothing(connect):
    tls = {"zenoh.tls.ca": "ca.pem"} if connect else {}
    config = load_config(None, {"zenoh.connect": connect, **tls})
    assert all(check.ok for check in exposure_checks(config))


def test_mavlink_on_a_network_is_warned_of():
    config = load_config(None, {"vehicle.mavlink": "udpin://0.0.0.0:14540"})
    zenoh, mavlink = exposure_checks(config)
    assert "NOT SIGNED" in mavlink.detail
    assert_advises(mavlink)
    assert zenoh.ok


@pytest.fixture
def section(tmp_path):
    return section_with(tmp_path, Validity.days_from_now(1))


def section_with(tmp_path, validity):
    """Settings with a certificate of its own authority; its files have no suffix."""
    authority = make_authority(validity)
    write_credentials(tmp_path / "made", authority, authority)
    names = ("ca", "certificate", "key")
    for name in names:
        (tmp_path / "made" / f"{name}.pem").rename(tmp_path / name)
    return load_config(None, {f"zenoh.tls.{n}": str(tmp_path / n) for n in names}).zenoh


def test_certificates_that_are_there_pass(section):
    require_usable_files(section)


def test_a_certificate_that_has_expired_is_refused_with_its_date(tmp_path):
    now = datetime.datetime.now(datetime.UTC)
    end = now - datetime.timedelta(days=1)
    section = section_with(tmp_path, Validity(now - datetime.timedelta(days=10), end))
    with pytest.raises(ConfigError, match=rf"certificate' expired on {end:%Y-%m-%d}"):
        require_usable_files(section)


@pytest.mark.parametrize("name", ["ca", "certificate", "key"])
def test_a_certificate_file_that_is_missing_or_none_is_named(section, tmp_path, name):
    (tmp_path / name).write_text("not PEM")
    with pytest.raises(ConfigError, match=rf"zenoh.tls.{name} = .* is not PEM"):
        require_usable_files(section)
    (tmp_path / name).unlink()
    with pytest.raises(ConfigError, match=rf"zenoh.tls.{name} = .* cannot be read"):
        require_usable_files(section)


def test_a_private_key_that_others_may_read_is_refused(section, tmp_path):
    (tmp_path / "key").chmod(0o640)
    with pytest.raises(ConfigError, match="0640"):
        require_usable_files(section)
