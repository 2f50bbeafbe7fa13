"""Settings of the dashboard from its command line; unprotected ones are refused."""

import ipaddress
import socket
import ssl
from argparse import Namespace
from dataclasses import dataclass, field
from pathlib import Path

from dfvs_core.errors import ConfigError
from dfvs_service.command import operators_zenoh
from dfvs_service.dashboard.address import PublicAddress
from dfvs_service.dashboard.tokens import Tokens
from dfvs_service.settings.config import load_config
from dfvs_service.settings.endpoints import is_loopback_host
from dfvs_service.settings.key_file import load_key
from dfvs_service.settings.sections import ZenohSection
from dfvs_service.zenoh_session import require_usable_files


@dataclass(frozen=True, slots=True)
class DashboardSettings:
    """How the dashboard is served.

    ``links`` are the Zenoh connections; ``command_key`` signs commands, None allows none.
    """

    address: PublicAddress
    links: tuple[ZenohSection, ...]
    tokens: Tokens = field(default_factory=Tokens)
    command_key: bytes | None = field(default=None, repr=False)


def dashboard_settings(arguments: Namespace) -> DashboardSettings:
    """Settings from parsed arguments.

    Raises
    ------
    ConfigError
        If a file cannot be used, the page could be reached from elsewhere without encryption and
        a token, or the port is taken.
    """
    tokens = _tokens(arguments)
    command_key = None if arguments.command_key is None else load_key(arguments.command_key)
    if command_key is not None and tokens.operator is None:
        raise ConfigError(
            "--command-key is given without --operator-token",
            "a token that tells who may send commands",
            "make one with: dfvs-dashboard new-token --token-file operator.token",
        )
    is_secure = _check_certificate(arguments.cert, arguments.key)
    if not is_loopback_host(arguments.host):
        _check_exposure(arguments, tokens, is_secure=is_secure)
    _check_port(arguments.host, arguments.port)
    names = map(_url_name, (arguments.host, *arguments.name))
    return DashboardSettings(
        address=PublicAddress.of(names, arguments.port, secure=is_secure),
        links=_links(arguments),
        tokens=tokens,
        command_key=command_key,
    )


def _tokens(arguments: Namespace) -> Tokens:
    viewer, operator = (
        None if path is None else load_key(path, "dfvs-dashboard new-token --token-file")
        for path in (arguments.viewer_token, arguments.operator_token)
    )
    if viewer is not None and viewer == operator:
        raise ConfigError(
            "--viewer-token and --operator-token hold the same token: viewers could command",
            "two tokens",
            "make one with: dfvs-dashboard new-token --token-file FILE",
        )
    return Tokens(viewer, operator, is_open=viewer is None and is_loopback_host(arguments.host))


def _check_certificate(cert: Path | None, key: Path | None) -> bool:
    """Whether TLS is to be used, after certificate and key were found to be a pair."""
    if cert is None and key is None:
        return False
    if cert is None or key is None:
        raise ConfigError("only one of --cert and --key is given", "both, or neither")
    try:
        ssl.SSLContext(ssl.PROTOCOL_TLS_SERVER).load_cert_chain(cert, key)
    except (OSError, ssl.SSLError) as error:
        raise ConfigError(
            f"--cert {cert} and --key {key} cannot be used ({error})",
            "PEM files that belong together",
        ) from error
    return True


def _check_exposure(arguments: Namespace, tokens: Tokens, *, is_secure: bool) -> None:
    missing = [] if is_secure else ["--cert and --key"]
    if tokens.viewer is None and tokens.operator is None:
        missing.append("--viewer-token or --operator-token")
    if _is_any(arguments.host) and not arguments.name:
        missing.append("--name with the name that browsers use")
    if missing:
        raise ConfigError(
            f"--host {arguments.host} can be reached from other machines",
            " and ".join(missing),
            "or leave --host out, and use an SSH tunnel",
        )


def _is_any(host: str) -> bool:
    try:
        return ipaddress.ip_address(host).is_unspecified
    except ValueError:
        return False


def _check_port(host: str, port: int) -> None:
    """Try to listen, so that what is wrong is reported in one line."""
    try:
        family = socket.getaddrinfo(host, port, type=socket.SOCK_STREAM)[0][0]
        with socket.socket(family) as probe:
            probe.setsockopt(socket.SOL_SOCKET, socket.SO_REUSEADDR, 1)
            probe.bind((host, port))
    except (OSError, OverflowError) as error:
        raise ConfigError(
            f"cannot listen on {host} port {port} ({error})",
            "an address of this machine and a free port",
            "choose another one with --port",
        ) from error


def _url_name(host: str) -> str:
    """Name as it stands in a URL: IPv6 addresses in brackets."""
    return f"[{host}]" if ":" in host and not host.startswith("[") else host


def _links(arguments: Namespace) -> tuple[ZenohSection, ...]:
    zenoh = load_config(arguments.config, {}).zenoh
    require_usable_files(zenoh)
    if not arguments.connect:
        return (operators_zenoh(zenoh),)
    return tuple(operators_zenoh(zenoh, endpoint) for endpoint in dict.fromkeys(arguments.connect))
