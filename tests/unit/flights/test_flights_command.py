"""``dfvs-service flights``: whole flights, and what a crash or a power loss leaves of them."""

import json
import os
import zipfile
from pathlib import Path

import pytest

from dfvs_service.cli import main
from dfvs_service.flights.cli import export_flight
from dfvs_service.flights.store import FlightStore

S = 1_000_000_000
START_NS = 100 * S


def transition(t_s, target, cause, detail=""):
    values = {"source": "", "target": target, "cause": cause, "detail": detail}
    return {"t_ns": START_NS + round(t_s * S), "kind": "transition", **values}


SERVO = [transition(1.0, "PREFLIGHT", "autopilot is heard"), transition(4.5, "SERVO", "engaged")]
ABORT = transition(9.25, "ABORT", "goal lost", "overlap 0.01")


@pytest.fixture
def flights(tmp_path, monkeypatch):
    monkeypatch.setenv("XDG_STATE_HOME", str(tmp_path))
    monkeypatch.delenv("STATE_DIRECTORY", raising=False)
    return FlightStore(tmp_path / "dfvs" / "flights")


def fly(store, gate, service, vehicle="drone1"):
    """The records of a flight; its folder."""
    folder, lock = store.create(vehicle, 1_700_000_000.0)
    lock.close()
    header = {"vehicle": vehicle, "started_ns": START_NS, "started_unix_ns": 1_700_000_000 * S}
    (folder / "flight.json").write_text(json.dumps(header) + "\n")
    for name, records in (("gate.jsonl", gate), ("service.jsonl", service)):
        (folder / name).write_text("".join(json.dumps(r) + "\n" for r in records))
    return folder


def end(code):
    return {"t_ns": START_NS + 12 * S, "kind": "end", "code": code}


def told(text):
    return {"t_ns": START_NS + 11 * S, "kind": "told", "text": text}


def shown(capsys, *words):
    assert main(["flights", "show", "latest", "--json", *words]) == 0
    return json.loads(capsys.readouterr().out)


def test_a_flight_that_reached_its_goal_says_so(flights, capsys):
    fly(flights, [*SERVO, transition(10, "DONE", "reached")], [end(0)])
    page = shown(capsys)
    assert (page["status"], page["exit_code"]) == ("ended", 0)
    assert page["verdict"] == "the goal was reached"
    assert page["started"] == "2023-11-14T22:13:20+00:00"
    assert page["duration_s"] == 12.0
    times = [(change["t_s"], change["state"]) for change in page["states"]]
    assert times == [(1.0, "PREFLIGHT"), (4.5, "SERVO"), (10.0, "DONE")]


def test_a_flight_that_ended_otherwise_says_why(flights, capsys):
    fly(flights, [*SERVO, ABORT], [end(1)])
    assert shown(capsys)["verdict"] == "ended in ABORT: goal lost (overlap 0.01)"


def test_an_error_that_the_user_was_told_is_the_verdict(flights, capsys):
    lines = [told("warning: a parameter is odd"), told("error: no autopilot is heard"), end(2)]
    fly(flights, [], lines)
    page = shown(capsys)
    assert page["verdict"] == "no autopilot is heard"
    assert page["told"] == ["warning: a parameter is odd", "error: no autopilot is heard"]


def test_a_flight_that_never_was_ready_says_what_it_waited_for(flights, capsys):
    ended = transition(40, "ABORT", "service stops")
    lines = [told("not ready: link: none"), told("not ready: frames: no goal (move)"), end(1)]
    fly(flights, [SERVO[0], ended], lines)
    waits = "ended in ABORT: service stops; not ready: frames: no goal (move)"
    assert shown(capsys)["verdict"] == waits
    fly(flights, [SERVO[0], transition(9, "READY", "checks passed"), ended], lines)
    assert shown(capsys)["verdict"] == "ended in ABORT: service stops"


@pytest.mark.parametrize("tail", [b"", b'{"t_ns":1', b"\0" * 50, b"\xff\xfe\n", b"[1]\n"])
def test_a_flight_that_was_cut_off_is_read_as_far_as_it_goes(tail, flights, capsys):
    folder = fly(flights, SERVO, [])
    with (folder / "gate.jsonl").open("ab") as file:
        file.write(tail)
    (folder / "gate-inputs.jsonl").write_bytes(
        b'{"format":1}\n{"t":%d,"in":[],"out":{}}\n{"t":' % (START_NS + 7 * S)
    )
    page = shown(capsys)
    assert page["status"] == "cut off"
    assert page["verdict"].startswith("cut off in SERVO")
    assert len(page["states"]) == 2
    assert page["duration_s"] == 7.0


def test_a_flight_whose_inputs_end_with_a_gap_lasts_until_their_last_step(flights, capsys):
    folder = fly(flights, SERVO, [])
    (folder / "gate-inputs.jsonl").write_bytes(
        b'{"t":%d,"in":[],"out":{}}\n{"gap": 3}\n' % (START_NS + 7 * S)
    )
    assert shown(capsys)["duration_s"] == 7.0


@pytest.mark.parametrize("content", [None, b"", b"\0" * 80, b"{"])
def test_a_flight_without_its_header_is_known_by_its_name(content, flights, capsys):
    folder = fly(flights, SERVO, [], vehicle="drone2")
    (folder / "flight.json").unlink()
    if content is not None:
        (folder / "flight.json").write_bytes(content)
    page = shown(capsys)
    assert (page["vehicle"], page["started"]) == ("drone2", "20231114T221320Z")
    assert page["duration_s"] == 3.5


def test_a_folder_without_any_record_is_listed_as_well(flights, capsys):
    _, lock = flights.create("drone1", 1_700_000_000.0)
    lock.close()
    assert main(["flights"]) == 0
    assert "cut off in IDLE" in capsys.readouterr().out


def test_a_running_flight_is_told_from_one_that_was_cut_off(flights, capsys):
    _, lock = flights.create("drone1", 1_700_000_000.0)
    assert shown(capsys)["status"] == "running"
    lock.close()
    assert shown(capsys)["status"] == "cut off"


def test_the_list_has_a_line_for_every_flight_oldest_first(flights, capsys):
    fly(flights, [*SERVO, ABORT], [end(1)])
    fly(flights, SERVO, [], vehicle="drone2")
    assert main(["flights"]) == 0
    heading, first, second = capsys.readouterr().out.splitlines()
    assert heading.split() == ["flight", "time", "size", "status", "verdict"]
    assert first.startswith("20231114T221320Z-drone1 ")
    assert "goal lost" in first
    assert second.startswith("20231114T221320Z-drone2 ")
    assert main(["flights", "list", "--json"]) == 0
    assert [f["vehicle"] for f in json.loads(capsys.readouterr().out)] == ["drone1", "drone2"]


def test_no_flights_are_no_error(flights, capsys):
    assert main(["flights"]) == 0
    assert str(flights.path) in capsys.readouterr().out


def test_the_folder_may_be_named_before_or_after_the_command(flights, tmp_path, capsys):
    fly(FlightStore(tmp_path / "other"), [], [])
    place = ["--folder", str(tmp_path / "other")]
    assert main(["flights", *place, "show", "latest"]) == 0
    assert main(["flights", "show", "latest", *place]) == 0
    one, two = capsys.readouterr().out.split("decide it again")[:2]
    assert "20231114T221320Z-drone1" in one
    assert main(["flights", "--set", f"black_box.folder={tmp_path / 'other'}"]) == 0
    assert "20231114T221320Z-drone1" in two + capsys.readouterr().out


def test_an_export_holds_every_file_of_the_flight(flights, tmp_path, capsys):
    folder = fly(flights, SERVO, [end(1)])
    (folder / "thumbnails").mkdir()
    (folder / "thumbnails" / "1.jpg").write_bytes(b"jpeg")
    target = tmp_path / "flight.zip"
    assert main(["flights", "export", folder.name, str(target)]) == 0
    with zipfile.ZipFile(target) as archive:
        files = {name: archive.read(name) for name in archive.namelist()}
    names = ("flight.json", "gate.jsonl", "service.jsonl", "thumbnails/1.jpg")
    assert files == {f"{folder.name}/{name}": (folder / name).read_bytes() for name in names}
    assert "4 files" in capsys.readouterr().out


def test_an_export_from_a_clock_that_was_never_set_is_a_whole_zip(flights, tmp_path):
    folder = fly(flights, SERVO, [end(1)])
    os.utime(folder / "gate.jsonl", (0, 0))
    target = tmp_path / "flight.zip"
    assert main(["flights", "export", "latest", str(target)]) == 0
    with zipfile.ZipFile(target) as archive:
        assert archive.read(f"{folder.name}/gate.jsonl") == (folder / "gate.jsonl").read_bytes()


def test_an_export_into_the_flight_s_own_folder_does_not_hold_itself(flights, monkeypatch):
    monkeypatch.chdir(fly(flights, SERVO, [end(1)]))
    assert main(["flights", "export", "latest", "flight.zip"]) == 0
    with zipfile.ZipFile("flight.zip") as archive:
        names = {Path(name).name for name in archive.namelist()}
    assert names == {"flight.json", "gate.jsonl", "service.jsonl"}


def test_an_export_that_is_ended_leaves_nothing_behind(flights, tmp_path, monkeypatch):
    def end_by_signal(*_):
        raise SystemExit(143)

    folder = fly(flights, [], [end(1)])
    monkeypatch.setattr(os, "replace", end_by_signal)
    with pytest.raises(SystemExit):
        export_flight(folder, tmp_path / "flight.zip")
    assert not list(tmp_path.glob("flight.zip*"))


def test_an_export_replaces_nothing(flights, tmp_path, capsys):
    fly(flights, [], [])
    target = tmp_path / "flight.zip"
    target.write_text("mine")
    assert main(["flights", "export", "latest", str(target)]) == 2
    assert target.read_text() == "mine"
    assert capsys.readouterr().err == f"error: {target} exists; expected a name that is free\n"


@pytest.mark.parametrize(
    "words",
    [["show", "20000101T000000Z-drone1"], ["show", "latest"], ["export", "latest", "x.zip"]],
)
def test_a_flight_that_is_not_there_is_said_in_one_line(words, flights, refused):
    assert "error: there is no flight" in refused(main, "flights", *words)


def test_an_export_to_nowhere_is_said_in_one_line(flights, tmp_path, refused):
    fly(flights, [], [])
    words = ("flights", "export", "latest", tmp_path / "none" / "x.zip")
    assert "No such file or directory" in refused(main, *words)
