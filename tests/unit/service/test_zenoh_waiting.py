"""Waiting for a router: what is said, and what ends at once."""

import datetime
import itertools

import numpy as np
import pytest
from loopback import free_endpoint, free_tcp_port

from dfvs_core.errors import ConfigError
from dfvs_core.messages.image import encode_png
from dfvs_core.messages.zenoh_settings import TlsFiles
from dfvs_service.camera import cli as camera_cli
from dfvs_service.certificates.authority import (
    Validity,
    make_authority,
    make_certificate,
    write_credentials,
)
from dfvs_service.live import foxglove_cli, metrics_cli
from dfvs_service.record import cli as record_cli
from dfvs_service.ros2 import cli as ros2_cli
from dfvs_service.settings.sections import ZenohSection
from dfvs_service.zenoh_session import open_persistently, open_session, open_within


def stopped_after(calls):
    counted = itertools.count()
    return lambda: next(counted) >= calls


@pytest.mark.parametrize(
    ("main", "words"),
    [
        (record_cli.main, ("--out", "recordings")),
        (foxglove_cli.main, ("--port", "0")),
        (metrics_cli.main, ("--port", "0")),
        (ros2_cli.main, ()),
        (camera_cli.main, ("--source", "goal.png")),
    ],
)
def test_a_private_key_that_cannot_be_read_ends_a_command(
    main, words, tmp_path, refused, monkeypatch
):
    monkeypatch.chdir(tmp_path)
    (tmp_path / "goal.png").write_bytes(encode_png(np.zeros((48, 64, 3), np.uint8)))
    config = tmp_path / "client.toml"
    config.write_text(
        f'[zenoh]\nmode = "client"\nconnect = ["{free_endpoint()}"]\n'
        '[zenoh.tls]\nca = "none.pem"\ncertificate = "none.pem"\nkey = "none.key"\n'
    )
    assert "zenoh.tls.ca" in refused(main, *words, "--config", config)


def test_a_router_that_is_missing_is_said_once():
    said = []
    section = ZenohSection("client", (free_endpoint(),), ())
    assert open_persistently(section, stopped_after(20), said.append, 0.0) is None
    (line,) = said
    assert line.startswith("nobody listens on")
    assert line.endswith("trying again every 0 s")


def test_waiting_ends_with_the_error_where_the_time_is_up():
    section = ZenohSection("client", (free_endpoint(),), ())
    with pytest.raises(ConfigError, match="nobody listens on"):
        open_within(section, 0.0, lambda: False)


@pytest.mark.parametrize("endpoint", ["tcp/127.0.0.1:99999", "tcp/127.0.0.1"])
def test_an_endpoint_that_is_none_is_named(endpoint):
    with pytest.raises(ConfigError) as error:
        open_session(ZenohSection(listen=(endpoint,)))
    assert f"({endpoint})" in error.value.problem
    assert "tcp/127.0.0.1:7447" in error.value.expected


def test_a_peer_is_not_tried_again():
    with pytest.raises(ConfigError):
        open_persistently(ZenohSection("peer", (), ("tcp/999.0.0.1:1",)), lambda: False, print)


def test_certificates_that_are_not_valid_yet_are_told_with_the_time_of_this_machine(tmp_path):
    """As where a clock was not set after a start without a network."""
    now = datetime.datetime.now(datetime.UTC)
    later = Validity(now + datetime.timedelta(days=2), now + datetime.timedelta(days=3))
    authority = make_authority(later)
    made = make_certificate(authority, "service.drone1", ("127.0.0.1",), later)
    write_credentials(folder := tmp_path / "early", made, authority)
    files = TlsFiles(*(str(folder / f"{name}.pem") for name in ("ca", "certificate", "key")))
    endpoint = f"tls/127.0.0.1:{free_tcp_port()}"
    with (
        open_session(ZenohSection("peer", (), (endpoint,), tls=files), ("drone1",)),
        pytest.raises(ConfigError, match=r"not valid at 20\d\d-"),
    ):
        open_session(ZenohSection("client", (endpoint,), (), tls=files))
