"""Zenoh sessions with errors for users."""

import dataclasses
import datetime
import importlib.util
import json
import math
import time
from collections.abc import Callable, Mapping
from pathlib import Path
from typing import Any

import zenoh
import zenoh.ext

from dfvs_common import zenoh_session
from dfvs_core.errors import ConfigError
from dfvs_core.messages.zenoh_settings import Encryption
from dfvs_service.ports import require_free_zenoh_ports, zenoh_port
from dfvs_service.settings.key_file import check_private
from dfvs_service.settings.runtime import RuntimeFolder
from dfvs_service.settings.sections import ZenohSection

_PEM = b"-----BEGIN "
_RETRY_S = 1.0
_LOCAL_RETRY_S = 0.1
_POLL_S = 0.05
"""An end that was asked for is noticed within this time."""


def open_session(config: ZenohSection, vehicles: tuple[str, ...] = ()) -> zenoh.Session:
    """Open a session as configured; a client listens on nothing.

    ``vehicles`` are those whose roles may do their work over encrypted links to this process.

    Raises
    ------
    ConfigError
        If the router cannot be reached (client), an endpoint cannot be listened on (peer), or a
        certificate's file cannot be used.
    """
    require_usable_files(config)
    encryption = None if config.tls is None else Encryption(config.tls, vehicles)
    listen = config.listen if config.mode == "peer" else ()
    try:
        return zenoh_session.open_session(config.mode, config.connect, listen, encryption)
    except ConfigError as error:
        if config.mode == "client":
            raise _unreachable(config, error.problem) from error
        require_free_zenoh_ports(config)
        raise ConfigError(
            f"{error.problem} ({', '.join((*config.connect, *listen))})",
            "a free listen endpoint, such as tcp/127.0.0.1:7447"
            + (", and a key that fits its certificate" if config.tls else ""),
            "see zenoh.listen and zenoh.connect in the configuration",
        ) from error


def _unreachable(config: ZenohSection, problem: str) -> ConfigError:
    """Error of a client that reaches neither a service nor a router."""
    remedy = (
        "start it, or name its endpoint (--config, --set zenoh.listen; zenoh.connect for a router)"
    )
    ports = [zenoh_port(endpoint) for endpoint in config.connect]
    if all(port is not None and port.is_unheard() for port in ports):
        problem = f"nobody listens on {', '.join(config.connect)}"
    elif config.tls is not None:
        now = datetime.datetime.now(datetime.UTC).isoformat(" ", "minutes")
        remedy += (
            f"; or is a certificate not valid at {now} (now), of another authority, or for other "
            "hosts than the endpoint's (dfvs-certs --host)?"
        )
    return ConfigError(problem, "a running dfvs-service there, or a router", remedy)


def publish_kept(
    session: zenoh.Session,
    key: str,
    congestion: zenoh.CongestionControl = zenoh.CongestionControl.DROP,
) -> zenoh.ext.AdvancedPublisher:
    """Publisher of a key whose last value is kept for subscribers that join later."""
    return zenoh.ext.declare_advanced_publisher(
        session,
        key,
        congestion_control=congestion,
        cache=zenoh.ext.CacheConfig(max_samples=1),
        publisher_detection=True,
    )


def has_subscriber(publisher: Any) -> bool:
    """Whether Zenoh knows a subscriber of a publisher's key."""
    # Zenoh's own type hint says bool, which it is not.
    return bool(publisher.matching_status.matching)


def subscribe_kept(
    session: zenoh.Session, key: str, on_sample: Callable[[zenoh.Sample], None]
) -> zenoh.ext.AdvancedSubscriber[None]:
    """Subscriber of a key that receives a kept value as well."""
    history = zenoh.ext.HistoryConfig(detect_late_publishers=True)
    return zenoh.ext.declare_advanced_subscriber(session, key, on_sample, history=history)


def subscribe_json(
    session: zenoh.Session, key: str, on_document: Callable[[Mapping[str, Any] | None], None]
) -> zenoh.Subscriber[None]:
    """Subscriber of JSON objects, on Zenoh's thread; it is given None for what is none."""

    def take(sample: zenoh.Sample) -> None:
        try:
            document = json.loads(sample.payload.to_bytes())
        except (ValueError, RecursionError):
            document = None
        on_document(document if isinstance(document, Mapping) else None)

    return session.declare_subscriber(key, take)


def attachment_of(sample: zenoh.Sample) -> bytes:
    """Attachment of a sample, empty where it has none."""
    return b"" if sample.attachment is None else sample.attachment.to_bytes()


def publisher_of(sample: zenoh.Sample) -> str:
    """Id of the Zenoh session that stamped a sample, empty where none did."""
    return "" if sample.timestamp is None else str(sample.timestamp.get_id())


def link_zenoh(config: ZenohSection, runtime: RuntimeFolder) -> ZenohSection:
    """Settings of the operator link: without a router the service's processes connect to it."""
    if config.mode == "client":
        return config
    return dataclasses.replace(config, listen=(*config.listen, _socket_endpoint(runtime)))


def inner_zenoh(config: ZenohSection, runtime: RuntimeFolder) -> ZenohSection:
    """Settings of the service's other processes: the router, or else the operator link."""
    if config.mode == "client":
        return config
    return ZenohSection("client", (_socket_endpoint(runtime),), ())


def _socket_endpoint(runtime: RuntimeFolder) -> str:
    return f"unixsock-stream/{runtime.zenoh_socket}"


def require_usable_files(section: ZenohSection) -> None:
    """Refuse certificates that no trying again makes usable, before Zenoh says it less clearly.

    Raises
    ------
    ConfigError
        If a file is not named or cannot be read, others may read the private key, or the
        certificate has expired; that is known only where the extra ``deploy`` is installed.
    """
    files = section.tls
    if files is None:
        return
    for name in ("ca", "certificate", "key"):
        path = Path(getattr(files, name))
        try:
            with path.open("rb") as file:
                begins = file.read(len(_PEM))
        except OSError as error:
            raise ConfigError(
                f"zenoh.tls.{name} = {str(path)!r} cannot be read ({error.strerror})",
                "a PEM file",
                "dfvs-certs makes them",
            ) from error
        if begins != _PEM:
            raise ConfigError(f"zenoh.tls.{name} = {str(path)!r} is not PEM", _PEM.decode())
    check_private(Path(files.key))
    if importlib.util.find_spec("cryptography") is not None:
        _require_valid(Path(files.certificate))


def _require_valid(path: Path) -> None:
    # An extra, needed here alone.
    from dfvs_service.certificates.authority import has_expired, read_certificate

    certificate = read_certificate(path)
    if has_expired(certificate):
        raise ConfigError(
            f"zenoh.tls.certificate = {str(path)!r} expired on "
            f"{certificate.not_valid_after_utc:%Y-%m-%d}",
            "one that is valid",
            "move its folder away and run dfvs-certs again",
        )


def open_persistently(
    section: ZenohSection,
    is_stopped: Callable[[], bool],
    log: Callable[[str], None],
    pause_s: float = _RETRY_S,
) -> zenoh.Session | None:
    """Open a session, however long its router stays away; None if stopped before.

    ``log`` receives the line about the first failure.

    Raises
    ------
    ConfigError
        If it cannot be opened and trying again would not help.
    """
    patience_s = math.inf if section.mode == "client" else 0.0
    return open_within(section, patience_s, is_stopped, log, pause_s)


def open_within(
    section: ZenohSection,
    patience_s: float,
    is_stopped: Callable[[], bool],
    log: Callable[[str], None] | None = None,
    pause_s: float = _LOCAL_RETRY_S,
) -> zenoh.Session | None:
    """Open a session to a process that may still be starting; None if stopped before.

    ``log`` receives the line about the first failure.

    Raises
    ------
    ConfigError
        If it does not answer in time, or a certificate's file cannot be used.
    """
    require_usable_files(section)
    deadline = time.monotonic() + patience_s
    while not is_stopped():
        try:
            return open_session(section)
        except ConfigError as error:
            if time.monotonic() >= deadline:
                raise
            if log is not None:
                log(f"{error}; trying again every {pause_s:g} s")
                log = None
        next_s = time.monotonic() + pause_s
        while not is_stopped() and time.monotonic() < next_s:
            time.sleep(min(pause_s, _POLL_S))
    return None
