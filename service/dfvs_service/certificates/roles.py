"""Certificate files of all roles in one folder."""

import argparse
import json
from pathlib import Path

from dfvs_core.errors import ConfigError
from dfvs_core.messages.topics import Topics
from dfvs_core.messages.zenoh_access import Role, certificate_name
from dfvs_core.messages.zenoh_settings import Encryption, TlsFiles, zenoh_settings
from dfvs_service.certificates.authority import (
    Credentials,
    Validity,
    make_authority,
    make_certificate,
    read_authority,
    write_credentials,
)

_LOOPBACK = ("localhost", "127.0.0.1")


def make_everything(arguments: argparse.Namespace) -> None:
    """Make an authority, unless one is there, and the certificates that are missing.

    Raises
    ------
    ConfigError
        If a name is none, or the authority that is there cannot be read.
    """
    out: Path = arguments.out
    vehicles = tuple(Topics(name).vehicle for name in arguments.vehicle or ["drone1"])
    if arguments.days < 1:
        raise ConfigError(f"--days {arguments.days}", "1 or more")
    validity = Validity.days_from_now(arguments.days)
    out.mkdir(mode=0o700, parents=True, exist_ok=True)
    authority = _authority(out / "authority", validity)
    hosts = tuple(dict.fromkeys((*arguments.host, *_LOOPBACK)))
    for role in Role:
        for vehicle in vehicles if role is not Role.ROUTER else vehicles[:1]:
            name = certificate_name(role, vehicle)
            if (out / name).exists():
                print(f"kept  {out / name}")
                continue
            listens = hosts if role in (Role.ROUTER, Role.SERVICE) else ()
            credentials = make_certificate(authority, name, listens, validity)
            write_credentials(out / name, credentials, authority)
            print(f"wrote {out / name}")
    document = router_document(vehicles, arguments.listen)
    path = out / "router" / "router.json5"
    path.write_text(json.dumps(document, indent=2) + "\n", encoding="utf-8")
    print(f"wrote {path}; start the router with: cd {path.parent} && zenohd -c {path.name}")


def _authority(folder: Path, validity: Validity) -> Credentials:
    if folder.exists():
        return read_authority(folder)
    authority = make_authority("DFVS authority", validity)
    write_credentials(folder, authority, authority)
    print(f"wrote {folder}; keep it off the aircraft")
    return authority


def router_document(vehicles: tuple[str, ...], endpoint: str) -> dict[str, object]:
    """Configuration of a Zenoh router that runs in the folder of its certificate."""
    files = TlsFiles("ca.pem", "certificate.pem", "key.pem")
    pairs = zenoh_settings("router", (), (endpoint,), Encryption(files, vehicles))
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
