"""Where flights lie, what they are called, and which go first."""

import errno
import fcntl
from pathlib import Path

import pytest

from dfvs_core.errors import ConfigError
from dfvs_service.flights.store import FlightStore, flights_folder, is_running
from dfvs_service.settings.record_sections import BlackBoxSection

T_S = 1_700_000_000.0


def flown(store, t_s, size=1000, vehicle="drone1"):
    """A flight that is over; its name."""
    folder, lock = store.create(vehicle, t_s)
    (folder / "gate.jsonl").write_bytes(bytes(size))
    lock.close()
    return folder.name


@pytest.mark.parametrize(
    ("setting", "environment", "expected"),
    [
        ("/flights", {"STATE_DIRECTORY": "/s"}, "/flights"),
        ("", {"STATE_DIRECTORY": "/var/lib/dfvs", "XDG_STATE_HOME": "/x"}, "/var/lib/dfvs/flights"),
        ("", {"STATE_DIRECTORY": "/a:/b"}, "/a/flights"),
        ("", {"XDG_STATE_HOME": "/x"}, "/x/dfvs/flights"),
        ("", {"XDG_STATE_HOME": "relative"}, "/home/pilot/.local/state/dfvs/flights"),
        ("", {}, "/home/pilot/.local/state/dfvs/flights"),
        ("~/mine", {}, "/home/pilot/mine"),
    ],
)
def test_the_folder_is_the_settings_or_the_systems(setting, environment, expected, monkeypatch):
    monkeypatch.setenv("HOME", "/home/pilot")
    section = BlackBoxSection(folder=setting)
    assert flights_folder(section, environment) == Path(expected)


def test_flights_of_one_second_have_names_of_their_own_in_their_order(tmp_path):
    store = FlightStore(tmp_path)
    names = [flown(store, T_S) for _ in range(11)]
    assert names[:2] == ["20231114T221320Z-drone1", "20231114T221320Z-drone1.2"]
    assert store.names() == names
    assert store.folder("latest").name == names[-1]


@pytest.mark.parametrize("later_s", [30.0, T_S - 86_400, T_S])
def test_a_flight_is_the_latest_whatever_the_clock_says(later_s, tmp_path):
    store = FlightStore(tmp_path)
    first = flown(store, T_S, vehicle="heron")
    second = flown(store, later_s, vehicle="drone1")
    third = flown(store, later_s + 60)
    fourth = flown(store, T_S + 3600)
    assert store.names() == [first, second, third, fourth]
    assert store.folder("latest").name == fourth
    store.make_room(2000)
    assert store.names() == [third, fourth]


def test_only_flights_are_listed(tmp_path):
    store = FlightStore(tmp_path / "none")
    assert store.names() == []
    name = flown(store, T_S)
    (store.path / "notes").mkdir()
    (store.path / f"{name}.txt").touch()
    assert store.names() == [name]


def test_the_oldest_flights_make_room(tmp_path):
    store = FlightStore(tmp_path)
    names = [flown(store, T_S + number) for number in range(5)]
    store.make_room(3500)
    assert store.names() == names[2:]


def test_a_running_flight_is_kept_whatever_its_size(tmp_path):
    store = FlightStore(tmp_path)
    folder, lock = store.create("drone1", T_S)
    (folder / "gate.jsonl").write_bytes(bytes(1000))
    flown(store, T_S + 1)
    assert is_running(folder)
    store.make_room(0)
    assert store.names() == [folder.name]
    lock.close()
    store.make_room(0)
    assert store.names() == []


def test_others_may_not_read_a_flight(tmp_path):
    store = FlightStore(tmp_path / "flights")
    folder, lock = store.create("drone1", T_S)
    lock.close()
    assert [path.stat().st_mode & 0o077 for path in (store.path, folder)] == [0, 0]


def test_a_file_system_without_locks_is_left_without_empty_flights(tmp_path, monkeypatch):
    def refuse(*_):
        raise OSError(errno.ENOSYS, "Function not implemented")

    monkeypatch.setattr(fcntl, "flock", refuse)
    store = FlightStore(tmp_path)
    for _ in range(2):
        with pytest.raises(OSError, match="not implemented"):
            store.create("drone1", T_S)
    assert store.names() == []


@pytest.mark.parametrize("name", ["20231114T221320Z-drone9", "../../etc", "latest"])
def test_a_flight_that_is_not_there_is_refused_by_name(name, tmp_path):
    with pytest.raises(ConfigError, match=name):
        FlightStore(tmp_path).folder(name)
