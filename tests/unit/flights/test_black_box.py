"""The records of one flight: what is kept, what is dropped, and that nothing raises."""

import json
import os
from types import SimpleNamespace

import cv2
import numpy as np
import pytest
from full_disk import no_file_above

from dfvs_core.geometry.camera import CameraModel
from dfvs_core.messages.goal import Goal, GoalSidecar
from dfvs_service.flights import black_box
from dfvs_service.flights.black_box import MB, BlackBox, Clock
from dfvs_service.flights.records import read_lines
from dfvs_service.flights.store import FlightStore, folder_bytes, is_running
from dfvs_service.settings.config import load_config
from dfvs_service.settings.runtime import RuntimeFolder
from dfvs_service.supervisor.parent import prepare_runtime

S = 1_000_000_000
GOAL = Goal(
    np.full((48, 64, 3), 90, np.uint8), GoalSidecar(CameraModel.from_horizontal_fov(64, 48, 1.2))
)


class Desk:
    """A black box with a runtime folder, a folder of flights and a clock of its own."""

    def __init__(self, folder, **settings):
        (folder / "run").mkdir()
        self.runtime = RuntimeFolder(folder / "run")
        config = load_config(None, {f"black_box.{key}": v for key, v in settings.items()})
        self.config = config
        prepare_runtime(self.runtime, config, GOAL)
        self.store = FlightStore(folder / "flights")
        self.now_ns = 5 * S
        self.warnings = []
        clock = Clock(lambda: self.now_ns, lambda: 1_699_999_995 * S + self.now_ns)
        self.box = BlackBox(config, self.store, self.runtime, clock, self.warnings.append)

    def later(self, seconds):
        self.now_ns += round(seconds * S)
        self.box.update()
        return self

    def log(self, **record):
        with self.runtime.gate_log.open("a") as file:
            file.write(json.dumps(record) + "\n")


@pytest.fixture
def desk(tmp_path):
    return Desk(tmp_path)


def test_a_flight_begins_with_its_settings_its_goal_and_its_start(desk):
    desk.later(0)
    folder = desk.box.folder
    (header,) = read_lines(folder / "flight.json")
    assert (header["vehicle"], header["started_ns"]) == ("drone1", 5 * S)
    assert (folder / "settings.json").read_text() == desk.config.to_json()
    assert (cv2.imread(str(folder / "goal.png")) == 90).all()
    assert GoalSidecar.from_json((folder / "goal.json").read_text()) == GOAL.sidecar
    assert is_running(folder)
    desk.box.close()
    assert not is_running(folder)


def test_logs_telemetry_and_views_are_kept_as_they_come(desk):
    desk.later(0)
    desk.log(t_ns=1, kind="transition")
    desk.box.add("state", b'{"state":"READY"}')
    desk.box.add("thumbnail", b"jpeg")
    desk.box.add("build", b'{"versions":{}}')
    desk.box.add("no-such-stream", b"?")
    desk.later(0.2)
    folder = desk.box.folder
    # Nothing was closed: what the process had written so far outlives it.
    assert (folder / "gate.jsonl").read_bytes() == desk.runtime.gate_log.read_bytes()
    told = list(read_lines(folder / "telemetry-000.jsonl"))
    assert told == [{"stream": "state", "data": {"state": "READY"}}]
    assert [p.read_bytes() for p in (folder / "thumbnails").iterdir()] == [b"jpeg"]
    assert json.loads((folder / "build.json").read_text()) == {"versions": {}}
    assert desk.box.dropped == 0


def test_the_standard_error_of_every_child_is_kept(desk):
    children = ("gate", "perception", "operator_link", "recorder", "black-box")
    for child in children:
        desk.runtime.stderr(child).write_text(f"{child} failed\n")
    desk.later(0)
    for child in children:
        assert (desk.box.folder / f"{child}.err").read_text() == f"{child} failed\n"


def test_what_was_written_reaches_the_disk_once_a_second(desk, monkeypatch):
    desk.later(0)
    desk.log(t_ns=1)
    desk.later(0.2)
    synced = []
    monkeypatch.setattr(
        os, "fdatasync", lambda fd: synced.append(os.readlink(f"/proc/self/fd/{fd}"))
    )
    desk.later(0.2)
    assert synced == []
    desk.later(0.7)
    assert synced == [str(desk.box.folder / "gate.jsonl")]
    desk.later(1.1)
    assert len(synced) == 1  # nothing new


def test_the_last_lines_are_kept_at_the_end(desk):
    desk.later(0)
    desk.log(t_ns=1, kind="end", code=0)
    desk.box.close()
    assert len(list(read_lines(desk.box.folder / "gate.jsonl"))) == 1


@pytest.mark.parametrize("obstacle", ["file", "name"])
def test_a_folder_that_cannot_be_made_is_a_warning_and_tried_again(obstacle, tmp_path):
    """Root may write anywhere, so permissions refuse nothing here."""
    desk = Desk(tmp_path)
    blocked = tmp_path / "flights"
    if obstacle == "file":
        blocked.write_text("no folder")
    else:
        blocked.symlink_to(tmp_path / "nowhere" / "else")
    for _ in range(10):
        desk.later(1)
        desk.box.add("state", b"{}")
    assert len(desk.warnings) == 1
    assert str(blocked) in desk.warnings[0]
    assert desk.box.dropped == 10
    desk.log(t_ns=1, kind="transition")
    blocked.unlink()
    desk.later(6)
    assert list(read_lines(desk.box.folder / "gate.jsonl")) == [{"t_ns": 1, "kind": "transition"}]


def test_a_disk_that_is_full_drops_telemetry_and_the_logs_catch_up(desk):
    desk.later(0)
    with no_file_above(100):
        for number in range(50):
            desk.box.add("state", json.dumps({"n": number}).encode())
        desk.log(t_ns=1)  # within the limit
        desk.later(1)
    assert len(desk.warnings) == 1
    assert "File too large" in desk.warnings[0]
    assert 0 < desk.box.dropped < 50
    desk.later(6)
    desk.box.add("state", b'{"n":50}')
    kept = [r["data"]["n"] for r in read_lines(desk.box.folder / "telemetry-000.jsonl")]
    assert kept == [*range(50 - desk.box.dropped), 50]
    assert list(read_lines(desk.box.folder / "gate.jsonl")) == [{"t_ns": 1}]


def test_the_disk_is_not_filled_to_its_end(tmp_path):
    desk = Desk(tmp_path, min_free_mb=1e6)
    desk.later(0)
    desk.box.add("state", b"{}")
    assert desk.box.dropped == 1
    assert "less than 1e+06 MB are free" in desk.warnings[0]


def test_a_flight_grows_to_its_largest_size_and_no_further(tmp_path):
    desk = Desk(tmp_path, max_flight_mb=10)
    desk.later(0)
    line = b'{"pad":"' + b"x" * 60_000 + b'"}'
    for _ in range(60):
        desk.box.add("servo", line)
        desk.box.add("thumbnail", bytes(60_000))
        desk.box.add("goal", bytes(60_000))
        desk.now_ns += 1
    for path in (desk.runtime.gate_inputs, desk.runtime.gate_log, desk.runtime.service_log):
        path.write_bytes((line + b"\n") * 100)
    desk.later(1)
    assert 8 * MB < folder_bytes(desk.box.folder) <= 10 * MB
    full = [line for line in desk.warnings if "as large as it may be" in line]
    assert len(full) == 3


def test_a_new_flight_makes_room_for_itself(tmp_path):
    desk = Desk(tmp_path, max_flight_mb=10, max_total_mb=30)
    for number in range(4):
        folder, lock = desk.store.create("drone1", 1_600_000_000 + number)
        (folder / "gate-inputs.jsonl").write_bytes(bytes(8 * MB))
        lock.close()
    desk.later(0)
    # Two of 8 MB and one that may grow to 10 MB are all that 30 MB hold.
    assert len(desk.store.names()) == 3
    assert desk.store.folder("latest") == desk.box.folder


class Disk:
    """Free space of every disk."""

    free = 10**12


@pytest.fixture
def disk(monkeypatch):
    disk = Disk()
    monkeypatch.setattr(black_box.shutil, "disk_usage", lambda _: SimpleNamespace(free=disk.free))
    return disk


def test_logs_too_are_not_written_on_a_disk_that_is_full(desk, disk):
    desk.later(0)
    disk.free = 0
    desk.log(t_ns=1)
    desk.later(0.2).later(5).later(1)
    assert not (desk.box.folder / "gate.jsonl").exists()
    disk.free = 10**12
    desk.later(6)
    assert list(read_lines(desk.box.folder / "gate.jsonl")) == [{"t_ns": 1}]


def test_what_is_sent_once_is_kept_as_soon_as_there_is_room(desk, disk):
    desk.later(0)
    disk.free = 0
    desk.later(1)
    for goal in (b"older", b"newer"):
        desk.box.add("goal", goal)
    desk.box.add("build", b"{}")
    desk.box.add("route", b'{"leg":1}')
    sent_ns = desk.now_ns
    disk.free = 10**12
    desk.later(6).later(1)
    folder = desk.box.folder
    assert (folder / "build.json").read_bytes() == b"{}"
    assert (folder / "goals" / f"{sent_ns}.jpg").read_bytes() == b"newer"
    kept = list(read_lines(folder / "telemetry-000.jsonl"))
    assert kept == [{"stream": "route", "data": {"leg": 1}}]


def test_a_disk_that_is_full_again_later_is_told_again(desk, disk):
    desk.later(0)
    for pause_s in (100, 200, 3600, 3800):
        disk.free = 10**12 * (pause_s in (200, 3800))
        desk.now_ns = pause_s * S
        for _ in range(6):
            desk.later(6)
    first, second = desk.warnings
    assert "are free" in first
    assert first != second  # what was told once is not shown again
