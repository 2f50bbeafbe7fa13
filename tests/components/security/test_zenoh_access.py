"""Certificates of ``dfvs-certs``, and real Zenoh: who gets through, and who does not."""

import contextlib
import shutil
import subprocess
import sys
import time
from concurrent.futures import ThreadPoolExecutor

import numpy as np
import pytest
import zenoh
from loopback import free_tcp_port
from waiting import until

from dfvs_core.errors import ConfigError
from dfvs_core.messages.image import encode_png
from dfvs_core.messages.topics import Topics
from dfvs_service.certificates.authority import (
    Validity,
    make_certificate,
    read_authority,
    write_credentials,
)
from dfvs_service.certificates.cli import main
from dfvs_service.operator_link.name_lease import NameLease
from dfvs_service.settings.config import load_config
from dfvs_service.zenoh_session import open_session, publish_kept, subscribe_kept

OURS, OTHER = Topics("drone1"), Topics("drone2")
KEYS = {
    "camera": OURS.camera,
    "calibration": OURS.calibration,
    "state": OURS.telemetry("state"),
    "turn": OURS.telemetry("turn"),
    "lease": OURS.lease("standby", "somebody"),
    "command": OURS.command,
    "new_goal": OURS.new_goal,
    "other camera": OTHER.camera,
    "other command": OTHER.command,
    "elsewhere": "somewhere/else",
}
MAY_SAY = {
    "service.drone1": {"state", "turn", "lease"},
    "camera.drone1": {"camera", "calibration"},
    "operator.drone1": {"command", "new_goal"},
    "dashboard.drone1": set(),
    "recorder.drone1": set(),
    "foxglove.drone1": set(),
    "metrics.drone1": set(),
    "camera.drone2": {"other camera"},
    "operator.drone2": {"other command"},
    "nobody": set(),
}
MAY_HEAR = {
    "service.drone1": {"camera", "calibration", "command", "new_goal", "lease"},
    "camera.drone1": set(),
    "operator.drone1": {"state", "turn", "camera"},
    "dashboard.drone1": {"state", "turn", "camera"},
    "recorder.drone1": {"state", "turn", "camera", "calibration"},
    "foxglove.drone1": {"turn"},
    "metrics.drone1": {"state"},
    "camera.drone2": set(),
    "operator.drone2": {"other camera"},
    "nobody": set(),
}


def make_certificates(folder, *words):
    assert main(["--out", str(folder), *words]) == 0


def tls(folder):
    files = {"ca": "ca.pem", "certificate": "certificate.pem", "key": "key.pem"}
    return {f"zenoh.tls.{key}": str(folder / name) for key, name in files.items()}


def client(endpoint, credentials):
    settings = {"zenoh.mode": "client", "zenoh.connect": [endpoint], "zenoh.listen": []}
    return open_session(load_config(None, {**settings, **tls(credentials)}).zenoh)


class Hub:
    """Where the links end, with what reached it and what it says on every key."""

    def __init__(self, session, endpoint, folder, speaker):
        self.session, self.endpoint, self.folder, self.speaker = session, endpoint, folder, speaker
        self.heard = []
        self.subscriber = session.declare_subscriber(
            "**", lambda s: self.heard.append((s.payload.to_string(), str(s.key_expr)))
        )

    def heard_from(self, name):
        return {key for who, key in self.heard if who == name}


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    folder = tmp_path_factory.mktemp("zenoh") / "certificates"
    endpoint = f"tls/127.0.0.1:{free_tcp_port()}"
    (folder.parent / "endpoint").write_text(endpoint)
    make_certificates(folder, "--vehicle", "drone1", "--vehicle", "drone2", "--listen", endpoint)
    return folder


def router_hub(folder):
    """A router, as zenohd would be with the same file."""
    endpoint = (folder.parent / "endpoint").read_text()
    # Its paths are relative: a router runs in the folder of its certificate.
    with contextlib.chdir(folder / "router"):
        session = zenoh.open(zenoh.Config.from_file("router.json5"))
    return Hub(session, endpoint, folder, "service.drone1")


def service_hub(folder):
    """The service itself, where others connect to it directly."""
    endpoint = f"tls/127.0.0.1:{free_tcp_port()}"
    overrides = {"zenoh.listen": [endpoint], **tls(folder / "service.drone1")}
    session = open_session(load_config(None, overrides).zenoh, ("drone1", "drone2"))
    return Hub(session, endpoint, folder, None)


@pytest.fixture(scope="module", params=[router_hub, service_hub])
def hub(request, folder):
    hub = request.param(folder)
    yield hub
    hub.session.close()


@pytest.fixture(scope="module")
def nobody(folder):
    """A certificate of our own authority with a name that has no role."""
    place = folder / "nobody"
    if not place.exists():
        authority = read_authority(folder / "authority")
        made = make_certificate(authority, "nobody", (), Validity.days_from_now(1))
        write_credentials(place, made, authority)
    return place


def test_every_name_may_do_its_roles_work_and_nothing_else(hub, folder, nobody):
    del nobody
    names = [name for name in MAY_SAY if hub.speaker or not name.startswith("service")]
    sessions = {name: client(hub.endpoint, folder / name) for name in names}
    told = {name: set() for name in names}
    subscribers = [
        session.declare_subscriber(
            key, lambda s, name=name, word=word: told[name].add((word, s.payload.to_string()))
        )
        for name, session in sessions.items()
        for word, key in KEYS.items()
    ]
    wildcards = {name: set() for name in names}
    subscribers += [
        session.declare_subscriber(
            "**", lambda s, name=name: wildcards[name].add((str(s.key_expr), s.payload.to_string()))
        )
        for name, session in sessions.items()
    ]
    allowed = [(name, KEYS[word]) for name in names for word in MAY_SAY[name]]

    def say_everything():
        for name, session in sessions.items():
            for key in KEYS.values():
                session.put(key, name)
        for key in KEYS.values():
            hub.session.put(key, "hub")

    def complete():
        say_everything()
        time.sleep(0.1)
        said = all(key in hub.heard_from(name) for name, key in allowed)
        heard = all((w, "hub") in told[n] for n in names for w in MAY_HEAR[n])
        return said and heard

    # What is allowed arrives; by then everything else has been said as often.
    assert until(complete)
    say_everything()
    time.sleep(0.5)
    for name in names:
        assert hub.heard_from(name) == {KEYS[word] for word in MAY_SAY[name]}, name
        others = {word for word, who in told[name] if who != name}
        assert others == MAY_HEAR[name], name
        keys = {key for key, who in wildcards[name] if who != name}
        assert keys == {KEYS[word] for word in MAY_HEAR[name]}, name
    assert len(subscribers) == len(names) * (len(KEYS) + 1)
    for session in sessions.values():
        session.close()


def test_what_is_kept_reaches_a_dashboard_that_joins_late(hub, folder):
    speaker = client(hub.endpoint, folder / hub.speaker) if hub.speaker else hub.session
    publisher = publish_kept(speaker, OURS.telemetry("config"))
    publisher.put("resolved")
    names = ("dashboard.drone1", "dashboard.drone2", "camera.drone1")
    sessions = {name: client(hub.endpoint, folder / name) for name in names}
    heard = []
    subscribers = [
        subscribe_kept(sessions[name], key, lambda _, name=name, key=key: heard.append((name, key)))
        for name in names
        for key in (OURS.telemetry("config"), "dfvs/*/config")
    ]
    # Of its own vehicle, whether it asks for that one or for all; nobody else hears anything.
    wanted = {("dashboard.drone1", OURS.telemetry("config")), ("dashboard.drone1", "dfvs/*/config")}
    assert until(lambda: set(heard) >= wanted)
    time.sleep(0.3)
    assert set(heard) == wanted
    for subscriber in subscribers:
        subscriber.undeclare()
    for session in sessions.values():
        session.close()
    publisher.undeclare()


def test_two_services_of_a_vehicle_see_each_others_lease(hub, folder):
    first = client(hub.endpoint, folder / "service.drone1")
    second = client(hub.endpoint, folder / "service.drone1") if hub.speaker else hub.session
    leases = [NameLease(session, OURS, lambda _: None) for session in (first, second)]
    assert until(lambda: leases[0].holders().standing_by == (leases[1].name,))
    assert until(lambda: leases[1].holders().standing_by == (leases[0].name,))
    for lease in leases:
        lease.close()
    for session in (first, second) if hub.speaker else (first,):
        session.close()


def test_who_has_no_certificate_of_our_authority_gets_no_link(hub, folder, tmp_path):
    make_certificates(tmp_path / "foreign", "--vehicle", "drone1")
    foreign = tmp_path / "foreign" / "camera.drone1"
    # It trusts our authority and has the right name, but a certificate of its own authority.
    shutil.copy(folder / "camera.drone1" / "ca.pem", foreign / "ca.pem")
    with pytest.raises(ConfigError, match="Zenoh cannot be opened"):
        client(hub.endpoint, foreign)
    # The other way round: somebody else's server is not believed.
    shutil.copytree(folder / "camera.drone1", tmp_path / "mine")
    make_certificates(tmp_path / "third", "--vehicle", "drone1")
    shutil.copy(tmp_path / "third" / "authority" / "certificate.pem", tmp_path / "mine" / "ca.pem")
    with pytest.raises(ConfigError, match="Zenoh cannot be opened"):
        client(hub.endpoint, tmp_path / "mine")


def test_plain_connections_and_those_without_a_certificate_get_no_link(hub, folder):
    address = hub.endpoint.removeprefix("tls/")
    plain = {"zenoh.mode": "client", "zenoh.connect": [f"tcp/{address}"], "zenoh.listen": []}
    with pytest.raises(ConfigError, match="Zenoh cannot be opened"):
        open_session(load_config(None, plain).zenoh)
    anonymous = zenoh.Config()
    anonymous.insert_json5("mode", '"client"')
    anonymous.insert_json5("connect/endpoints", f'["{hub.endpoint}"]')
    anonymous.insert_json5("scouting/multicast/enabled", "false")
    ca = folder / "camera.drone1" / "ca.pem"
    anonymous.insert_json5("transport/link/tls/root_ca_certificate", f'"{ca}"')
    with pytest.raises(zenoh.ZError):
        zenoh.open(anonymous)


def test_a_second_run_keeps_what_is_there_and_adds_what_is_missing(folder):
    before = (folder / "camera.drone1" / "key.pem").read_bytes()
    shutil.rmtree(folder / "recorder.drone2")
    endpoint = (folder.parent / "endpoint").read_text()
    make_certificates(folder, "--vehicle", "drone1", "--vehicle", "drone2", "--listen", endpoint)
    assert (folder / "camera.drone1" / "key.pem").read_bytes() == before
    assert (folder / "recorder.drone2" / "key.pem").exists()


def test_a_camera_without_a_cameras_role_says_so_and_ends(hub, folder, tmp_path):
    (tmp_path / "0.png").write_bytes(encode_png(np.zeros((48, 64, 3), np.uint8)))

    def film(name):
        words = ["--source", str(tmp_path), "--loop", "--rate", "10", "--frames", "45"]
        words += ["--vehicle", "drone1", "--connect", hub.endpoint, "--require-subscriber", "3"]
        for key, path in tls(folder / name).items():
            words += ["--set", f"{key}={path!r}"]
        command = [sys.executable, "-m", "dfvs_service.camera.cli", *words]
        ended = subprocess.run(command, capture_output=True, text=True, timeout=60, check=False)
        return ended.returncode, ended.stderr

    service = client(hub.endpoint, folder / hub.speaker) if hub.speaker else hub.session
    subscriber = service.declare_subscriber(OURS.camera, lambda _: None)
    with ThreadPoolExecutor(2) as pool:  # each waits 3 s for somebody who receives
        camera, dashboard = pool.map(film, ("camera.drone1", "dashboard.drone1"))
    code, error = camera
    assert (code, "nobody receives" in error) == (0, False), error
    code, error = dashboard
    assert code == 2
    assert "nobody receives dfvs/drone1/camera" in error.splitlines()[-1]
    assert "must have the role of a camera" in error.splitlines()[-1]
    subscriber.undeclare()
    if hub.speaker:
        service.close()
