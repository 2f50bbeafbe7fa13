"""Certificate files of all roles in one folder."""

import argparse
import json
import re
from collections.abc import Iterable
from dataclasses import dataclass
from pathlib import Path

from dfvs_common.atomic_file import write_atomic
from dfvs_common.command_line import require_range
from dfvs_core.errors import ConfigError
from dfvs_core.messages.topics import Topics
from dfvs_core.messages.zenoh_access import Role, certificate_name
from dfvs_core.messages.zenoh_settings import Encryption, TlsFiles, is_encrypted, zenoh_settings
from dfvs_service.certificates.authority import (
    Credentials,
    Validity,
    has_expired,
    host_name,
    is_for_host,
    make_authority,
    make_certificate,
    read_authority,
    read_certificate,
    write_credentials,
)

_LOOPBACK = ("localhost", "127.0.0.1")
_LISTEN = "tls/0.0.0.0:7447"
_ENDPOINT = re.compile(r"\w+/[^\s/?#]+:\d{1,5}([?#]\S*)?")
"""Zenoh endpoint: protocol, host and port, and what may follow of metadata and configuration."""
_MAX_DAYS = 36_500
_MAX_VEHICLE = 64 - len(certificate_name(Role.DASHBOARD, ""))
"""Longest name of a vehicle: a certificate's common name has 64 characters (X.520)."""
_ROUTER_FILE = Path("router", "router.json5")


def make_everything(arguments: argparse.Namespace) -> None:
    """Make an authority, unless one is there, and the certificates that are missing.

    Raises
    ------
    ConfigError
        If a name, a host, the endpoint or the validity is none, or the authority that is there
        cannot be read.
    """
    out: Path = arguments.out
    vehicles = tuple(Topics(name).vehicle for name in arguments.vehicle or ["drone1"])
    longest = max(vehicles, key=len)
    if len(longest) > _MAX_VEHICLE:
        raise ConfigError(f"--vehicle {longest!r}", f"at most {_MAX_VEHICLE} characters")
    require_range(arguments, 1, _MAX_DAYS, "days")
    listen = arguments.listen
    if listen is not None and not (is_encrypted(listen) and _ENDPOINT.fullmatch(listen)):
        raise ConfigError(f"--listen {listen!r}", f"an endpoint such as {_LISTEN}")
    for host in arguments.host:
        host_name(host)
    validity = Validity.days_from_now(arguments.days)
    out.mkdir(mode=0o700, parents=True, exist_ok=True)
    earlier = _earlier_router(out / _ROUTER_FILE)
    authority = _authority(out / "authority", validity)
    validity = validity.within(authority.certificate)
    hosts = tuple(dict.fromkeys((*arguments.host, *_LOOPBACK)))
    for role in Role:
        for vehicle in vehicles if role is not Role.ROUTER else vehicles[:1]:
            name = certificate_name(role, vehicle)
            listens = hosts if role in (Role.ROUTER, Role.SERVICE) else ()
            if (out / name).exists():
                _report_kept(out / name, listens)
                continue
            credentials = make_certificate(authority, name, listens, validity)
            write_credentials(out / name, credentials, authority)
            print(f"wrote {out / name}")
    everybody = {*earlier.vehicles, *_vehicles_of(path.name for path in out.iterdir()), *vehicles}
    endpoints = earlier.endpoints if listen is None else (listen,)
    _write_router_file(out / _ROUTER_FILE, earlier, _Router(endpoints, tuple(sorted(everybody))))


def _report_kept(folder: Path, hosts: tuple[str, ...]) -> None:
    """Tell of a certificate that stays as it is, and of one that is not good, or not for a host."""
    certificate = read_certificate(folder / "certificate.pem")
    missing = [host for host in hosts if not is_for_host(certificate, host)]
    faults = ["has expired"] if has_expired(certificate) else []
    faults += [f"is not for {', '.join(missing)}"] if missing else []
    told = f", which {' and '.join(faults)}: move it away to renew it" if faults else ""
    print(f"kept  {folder}{told}")


@dataclass(frozen=True, slots=True)
class _Router:
    """What a router's file says: where it listens, and whose roles may do their work."""

    endpoints: tuple[str, ...] = (_LISTEN,)
    vehicles: tuple[str, ...] = ()


def _earlier_router(path: Path) -> _Router:
    """Router's file of an earlier run.

    Raises
    ------
    ConfigError
        If it is not as it was written.
    """
    if not path.exists():
        return _Router()
    try:
        document = json.loads(path.read_text(encoding="utf-8"))
        names = [subject["id"] for subject in document["access_control"]["subjects"]]
        return _Router(tuple(document["listen"]["endpoints"]), _vehicles_of(names))
    except (ValueError, KeyError, TypeError) as error:
        raise ConfigError(
            f"{path} cannot be read ({error!r})", "a file as dfvs-certs writes it", "move it away"
        ) from error


def _vehicles_of(names: Iterable[str]) -> tuple[str, ...]:
    """Vehicles whose service is among names of certificates; a copy's name has one dot more."""
    parts = (name.split(".") for name in names)
    return tuple(part[1] for part in parts if part[0] == Role.SERVICE and len(part) == 2)


def _text_of(router: _Router) -> bytes:
    document = router_document(router.vehicles, router.endpoints)
    return (json.dumps(document, indent=2) + "\n").encode()


def _write_router_file(path: Path, earlier: _Router, router: _Router) -> None:
    """Write the router's file; one that is not as ``earlier`` was written stays beside it."""
    text = _text_of(router)
    if path.exists() and (found := path.read_bytes()) not in (text, _text_of(earlier)):
        old = path.with_name(f"{path.name}.old")
        write_atomic(old, found)
        print(f"kept  {old}: carry over what you added to it")
    write_atomic(path, text)
    print(f"wrote {path}; start the router with: cd {path.parent} && zenohd -c {path.name}")


def _authority(folder: Path, validity: Validity) -> Credentials:
    if folder.exists():
        return read_authority(folder)
    authority = make_authority(validity)
    write_credentials(folder, authority, authority)
    print(f"wrote {folder}; keep it off the aircraft")
    return authority


def router_document(vehicles: tuple[str, ...], endpoints: tuple[str, ...]) -> dict[str, object]:
    """Configuration of a Zenoh router that runs in the folder of its certificate."""
    files = TlsFiles("ca.pem", "certificate.pem", "key.pem")
    pairs = zenoh_settings("router", (), endpoints, Encryption(files, vehicles))
    document: dict[str, object] = {}
    for path, value in pairs:
        *parents, last = path.split("/")
        place: dict[str, object] = document
        for parent in parents:
            inner = place.setdefault(parent, {})
            if not isinstance(inner, dict):
                raise TypeError(f"{path}: {parent} is a value")
            place = inner
        place[last] = json.loads(value)
    return document
