import socket
import sys

import pytest
from loopback import free_tcp_port
from self_signed import self_signed

from dfvs_service.dashboard import cli
from dfvs_service.dashboard.settings import dashboard_settings
from dfvs_service.settings.key_file import create_key


def settings(*words):
    return dashboard_settings(
        cli.make_parser().parse_args(["--port", str(free_tcp_port()), *words])
    )


@pytest.fixture
def token(tmp_path):
    create_key(tmp_path / "token")
    return str(tmp_path / "token")


@pytest.fixture(scope="module")
def certificate(tmp_path_factory):
    cert, key = self_signed(tmp_path_factory.mktemp("tls"))
    return ("--cert", cert, "--key", key)


@pytest.fixture
def refusal(refused):
    """The one line that a refused command prints."""
    return lambda *words: refused(cli.main, "--port", free_tcp_port(), *words)


def test_by_default_this_machine_alone_may_look_and_nobody_may_order():
    plain = settings()
    assert plain.address.scheme == "http"
    assert all(
        host.split(":")[0] in ("127.0.0.1", "localhost", "[") for host in plain.address.hosts
    )
    assert plain.tokens.is_open
    assert plain.command_key is None
    (link,) = plain.links
    assert (link.mode, link.connect) == ("client", ("tcp/127.0.0.1:7447",))


def test_every_endpoint_is_a_link_of_its_own():
    links = settings("--connect", "tcp/127.0.0.1:7001", "--connect", "tcp/127.0.0.1:7002").links
    assert [link.connect for link in links] == [("tcp/127.0.0.1:7001",), ("tcp/127.0.0.1:7002",)]


@pytest.mark.parametrize("host", ["0.0.0.0", "::"])
def test_beyond_this_machine_everything_is_asked_for_at_once(host, refusal):
    line = refusal("--host", host)
    for needed in ("--cert and --key", "--viewer-token or --operator-token", "--name"):
        assert needed in line


def test_beyond_this_machine_encryption_alone_is_not_enough(certificate, refusal):
    line = refusal("--host", "0.0.0.0", "--name", "drone1.local", *certificate)
    assert "--viewer-token or --operator-token" in line
    assert "--cert" not in line.split("expected")[1]


def test_with_certificate_and_token_others_may_look_once_signed_in(certificate, token):
    open_to_net = settings(
        "--host", "0.0.0.0", "--name", "drone1.local", *certificate, "--operator-token", token
    )
    assert open_to_net.address.scheme == "https"
    assert any(host.startswith("drone1.local:") for host in open_to_net.address.hosts)
    assert not open_to_net.tokens.is_open


def test_a_viewer_token_closes_the_page_on_this_machine_as_well(token):
    assert not settings("--viewer-token", token).tokens.is_open


def test_a_key_for_orders_needs_an_operator(token, refusal):
    assert "--operator-token" in refusal("--command-key", token)


def test_files_that_cannot_be_used_are_named(tmp_path, certificate, refusal):
    (tmp_path / "open").write_text("x" * 40)
    (tmp_path / "open").chmod(0o644)
    assert "0600" in refusal("--operator-token", str(tmp_path / "open"))
    assert "--cert" in refusal("--cert", str(tmp_path / "none"), "--key", str(tmp_path))
    assert "only one of" in refusal(*certificate[:2])
    assert "TOML" in refusal("--config", str(tmp_path / "none.toml"))
    files = "\n".join(f'{name} = "{tmp_path}/none.pem"' for name in ("ca", "certificate", "key"))
    (tmp_path / "tls.toml").write_text(f"[zenoh.tls]\n{files}\n")
    for connect in ((), ("--connect", "tls/127.0.0.1:7447")):
        line = refusal("--config", str(tmp_path / "tls.toml"), *connect)
        assert "zenoh.tls.ca" in line


def test_a_port_that_is_taken_is_said_before_anything_starts(refused):
    with socket.socket() as taken:
        taken.bind(("127.0.0.1", 0))
        taken.listen()
        error = refused(cli.main, "--port", taken.getsockname()[1])
    assert "choose another one with --port" in error


def test_viewers_do_not_have_the_operator_s_token(token, refusal):
    assert "viewers could command" in refusal("--viewer-token", token, "--operator-token", token)


@pytest.mark.parametrize("option", ["--viewer-token", "--operator-token"])
def test_a_token_that_is_missing_is_made_by_the_dashboard_s_own_command(tmp_path, refusal, option):
    path = str(tmp_path / "none")
    assert f"dfvs-dashboard new-token --token-file {path}" in refusal(option, path)


def test_a_new_token_is_a_private_file(tmp_path, capfd, refused):
    path = tmp_path / "fresh"
    words = ["new-token", "--token-file", str(path)]
    assert cli.main(words) == 0
    assert path.stat().st_mode & 0o777 == 0o600
    assert path.read_text().strip() not in capfd.readouterr().out
    refused(cli.main, *words)


@pytest.mark.parametrize("package", ["starlette", "uvicorn", "websockets"])
def test_without_the_extra_it_says_what_to_install(package, monkeypatch, refusal):
    monkeypatch.setitem(sys.modules, package, None)
    assert "pip install 'dfvs[dashboard]'" in refusal()
