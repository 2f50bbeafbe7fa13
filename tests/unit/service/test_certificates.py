"""``dfvs-certs``: what it writes, and which role each program has."""

import datetime
import importlib.util
import json
import re
import shutil
import stat
import tomllib
from pathlib import Path

import pytest
from cryptography.hazmat.primitives.serialization import (
    BestAvailableEncryption,
    Encoding,
    PrivateFormat,
)
from full_disk import no_file_above

from dfvs_core.messages.zenoh_access import Role, certificate_name
from dfvs_service.certificates.authority import (
    Validity,
    is_for_host,
    make_authority,
    make_certificate,
    read_certificate,
    write_credentials,
)
from dfvs_service.certificates.cli import main

ROOT = Path(__file__).parents[3]
SECURITY = (ROOT / "docs" / "how-to" / "security.md").read_text(encoding="utf-8")
WITHOUT_ZENOH = {"dfvs-report", "dfvs-replay", "dfvs-certs"}


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    folder = tmp_path_factory.mktemp("certificates") / "made"
    assert main(["--out", str(folder), "--vehicle", "drone1", "--vehicle", "drone2"]) == 0
    return folder


def test_every_role_has_a_certificate_of_its_name_and_keys_are_private(folder):
    for vehicle in ("drone1", "drone2"):
        for role in Role:
            name = certificate_name(role, vehicle)
            certificate = read_certificate(folder / name / "certificate.pem")
            assert certificate.subject.rfc4514_string() == f"CN={name}"
    for key in folder.rglob("key.pem"):
        assert stat.S_IMODE(key.stat().st_mode) == 0o600
        assert stat.S_IMODE(key.parent.stat().st_mode) == 0o700


def test_the_router_s_file_names_no_folder_so_that_it_may_be_moved(folder, tmp_path):
    text = (folder / "router" / "router.json5").read_text(encoding="utf-8")
    assert str(folder) not in text
    files = json.loads(text)["transport"]["link"]["tls"]
    moved = shutil.copytree(folder / "router", tmp_path / "moved")
    paths = [value for value in files.values() if isinstance(value, str)]
    assert paths
    assert all((moved / path).is_file() and not Path(path).is_absolute() for path in paths)


def router_of(folder):
    return json.loads((folder / "router" / "router.json5").read_text(encoding="utf-8"))


def test_a_vehicle_that_is_added_takes_nothing_from_those_before(tmp_path):
    listen = "tls/192.168.1.10:7450#iface=eth0"
    assert main(["--out", str(tmp_path), "--vehicle", "drone1", "--listen", listen]) == 0
    first = router_of(tmp_path)
    (tmp_path / "service.drone1").rename(tmp_path / "service.drone1.old")
    assert main(["--out", str(tmp_path), "--vehicle", "drone2"]) == 0
    both = router_of(tmp_path)
    names = {subject["id"] for subject in both["access_control"]["subjects"]}
    assert {"service.drone1", "camera.drone1", "service.drone2", "camera.drone2"} <= names
    assert both["listen"] == first["listen"] == {"endpoints": [listen]}


def test_a_folder_is_there_once_it_is_whole_and_made_anew_after_an_interruption(tmp_path):
    authority = make_authority(Validity.days_from_now(1))
    with no_file_above(300), pytest.raises(OSError, match="File too large"):  # the key fits
        write_credentials(tmp_path / "role", authority, authority)
    assert not (tmp_path / "role").exists()
    write_credentials(tmp_path / "role", authority, authority)
    assert [path.name for path in tmp_path.iterdir()] == ["role"]
    assert len(list((tmp_path / "role").iterdir())) == 3


def test_a_router_s_file_that_was_changed_by_hand_stays_beside_the_new_one(tmp_path, refused):
    assert main(["--out", str(tmp_path)]) == 0
    path = tmp_path / "router" / "router.json5"
    edited = path.read_text(encoding="utf-8").replace("{", '{ "id": "aa",', 1)
    path.write_text(edited, encoding="utf-8")
    assert main(["--out", str(tmp_path)]) == 0
    assert path.with_name("router.json5.old").read_text(encoding="utf-8") == edited
    assert "id" not in router_of(tmp_path)
    path.write_text("// mine", encoding="utf-8")
    assert "move it away" in refused(main, "--out", tmp_path)


def test_a_router_s_file_that_finds_no_room_leaves_the_old_one(tmp_path):
    assert main(["--out", str(tmp_path)]) == 0
    path = tmp_path / "router" / "router.json5"
    before = path.read_bytes()
    assert main(["--out", str(tmp_path), "--vehicle", "drone2"]) == 0
    path.write_bytes(before)
    with no_file_above(len(before)):
        assert main(["--out", str(tmp_path), "--vehicle", "drone2"]) == 2
    assert path.read_bytes() == before
    assert main(["--out", str(tmp_path), "--vehicle", "drone2"]) == 0
    assert "service.drone2" in path.read_text(encoding="utf-8")


def test_a_router_s_file_as_it_was_written_is_replaced_and_what_was_kept_by_hand_stays(
    tmp_path, capsys
):
    assert main(["--out", str(tmp_path), "--vehicle", "drone1"]) == 0
    assert main(["--out", str(tmp_path), "--vehicle", "drone2"]) == 0
    path = tmp_path / "router" / "router.json5"
    old = path.with_name("router.json5.old")
    assert not old.exists()
    assert "carry over" not in capsys.readouterr().out
    edited = path.read_text(encoding="utf-8").replace("{", '{ "id": "aa",', 1)
    path.write_text(edited, encoding="utf-8")
    for name in ("drone3", "drone4"):
        assert main(["--out", str(tmp_path), "--vehicle", name]) == 0
    assert old.read_text(encoding="utf-8") == edited


def end_of(folder, name):
    return read_certificate(folder / name / "certificate.pem").not_valid_after_utc


def days(begin, end):
    now = datetime.datetime.now(datetime.UTC)
    return Validity(now + datetime.timedelta(begin), now + datetime.timedelta(end))


def with_authority(folder, validity):
    authority = make_authority(validity)
    write_credentials(folder / "authority", authority, authority)
    return authority


def test_an_authority_that_has_expired_signs_nothing(tmp_path, refused):
    with_authority(tmp_path, days(-400, -35))
    assert "expired on" in refused(main, "--out", tmp_path)
    assert [path.name for path in tmp_path.iterdir()] == ["authority"]


def test_no_certificate_outlives_its_authority(tmp_path):
    with_authority(tmp_path, days(-300, 65))
    assert main(["--out", str(tmp_path)]) == 0
    assert end_of(tmp_path, "camera.drone1") == end_of(tmp_path, "authority")


def test_a_certificate_that_is_kept_tells_that_it_has_expired(tmp_path, capsys):
    authority = with_authority(tmp_path, days(-400, 65))
    old = make_certificate(authority, "camera.drone1", (), days(-400, -35))
    write_credentials(tmp_path / "camera.drone1", old, authority)
    assert main(["--out", str(tmp_path)]) == 0
    (line,) = [text for text in capsys.readouterr().out.splitlines() if text.startswith("kept")]
    assert "camera.drone1" in line
    assert "expired" in line


def test_a_certificate_that_is_kept_tells_which_host_it_lacks(tmp_path, capsys):
    assert main(["--out", str(tmp_path), "--host", "10.0.0.1"]) == 0
    capsys.readouterr()
    assert main(["--out", str(tmp_path), "--host", "10.0.0.1", "--host", "ground.local"]) == 0
    lines = [line for line in capsys.readouterr().out.splitlines() if "is not for" in line]
    assert [Path(line.split()[1].rstrip(",")).name for line in lines] == [
        "router",
        "service.drone1",
    ]
    assert all("is not for ground.local: move it away" in line for line in lines)


def test_a_certificate_of_ones_own_that_names_no_machine_is_for_no_host(tmp_path):
    assert not is_for_host(with_authority(tmp_path, days(-1, 65)).certificate, "10.0.0.1")


def test_without_cryptography_it_says_what_to_install(tmp_path, monkeypatch, refused):
    monkeypatch.setattr(importlib.util, "find_spec", lambda _: None)
    assert "pip install 'dfvs[deploy]'" in refused(main, "--out", tmp_path / "none")
    assert not (tmp_path / "none").exists()


def test_an_authority_that_cannot_be_read_is_one_line(tmp_path, refused):
    (tmp_path / "authority").mkdir()
    assert "holds no certificate" in refused(main, "--out", tmp_path)


@pytest.mark.parametrize(
    ("words", "told"),
    [
        (["--vehicle", "v" * 55], "at most 54 characters"),
        (["--vehicle", "Bad Name"], "vehicle name"),
        *((["--days", days], "1 to 36500") for days in ("0", "3000000")),
        *(
            (["--listen", endpoint], "an endpoint such as tls/0.0.0.0:7447")
            for endpoint in ("", "0.0.0.0:7447", "tls/drone", "tcp/0.0.0.0:7447", "tls/a b:7447")
        ),
        *(
            (["--host", host], f"--host {host!r}; expected an address, or a name")
            for host in ("", "192.168.1.10:7447", "tls/drone", "two words", "dröhne.local")
        ),
    ],
)
def test_what_no_certificate_can_hold_is_refused_before_anything_is_written(
    words, told, tmp_path, refused
):
    assert told in refused(main, "--out", tmp_path / "none", *words)
    assert not (tmp_path / "none").exists()


def test_the_longest_vehicle_name_and_every_kind_of_host_have_certificates(tmp_path):
    hosts = ("192.168.1.10", "fe80::1", "drone.local", "*.example.com", "xn--drhne-lua")
    words = [word for host in hosts for word in ("--host", host)]
    assert main(["--out", str(tmp_path), "--vehicle", "v" * 54, *words]) == 0


def test_an_authority_whose_key_has_a_passphrase_is_one_line(tmp_path, refused):
    authority = with_authority(tmp_path, days(-1, 65))
    encrypted = authority.key.private_bytes(
        Encoding.PEM, PrivateFormat.PKCS8, BestAvailableEncryption(b"secret")
    )
    (tmp_path / "authority" / "key.pem").write_bytes(encrypted)
    assert "holds no authority" in refused(main, "--out", tmp_path)


def test_the_docs_name_every_role_and_every_program_that_meets_others():
    rows = re.findall(r"^\| `([a-z0-9]+)(?:\.drone1)?` \| (.*?) \|", SECURITY, re.MULTILINE)
    assert {role for role, _ in rows} == {role.value for role in Role}
    named = {word for _, programs in rows for word in re.findall(r"dfvs-[a-z0-9]+", programs)}
    scripts = tomllib.loads((ROOT / "pyproject.toml").read_text(encoding="utf-8"))["project"]
    ours = {name for name, entry in scripts["scripts"].items() if entry.startswith("dfvs_service.")}
    assert named == ours - WITHOUT_ZENOH
