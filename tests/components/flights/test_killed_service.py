"""The real service is killed in flight: its black box lists, shows, exports and replays."""

import html
import json
import os
import signal
import time
import zipfile

import cv2
import numpy as np
import pytest

from dfvs_core.gate.config import S
from dfvs_core.gate.events import Action
from dfvs_core.gate.states import GateState
from dfvs_robustness.harness.harness import Harness
from dfvs_robustness.harness.service import CHILDREN, wait_until
from dfvs_robustness.harness.setup import Setup
from dfvs_service.cli import main
from dfvs_service.flights.records import read_lines
from dfvs_service.flights.store import is_running
from dfvs_service.report.cli import main as report

pytestmark = pytest.mark.real_time

LATENESS_S = 2.0
"""Logs are copied five times a second; the rest is for a busy machine."""


@pytest.fixture(scope="module")
def flights(tmp_path_factory):
    return tmp_path_factory.mktemp("flights")


@pytest.fixture(scope="module")
def rig(tmp_path_factory, flights):
    settings = ("black_box.enabled=true", f"black_box.folder='{flights}'")
    rig = Harness(Setup(settings=settings), tmp_path_factory.mktemp("rig"), seed=1)
    yield rig
    rig.close()


def fly(rig, flights):
    """Fly until the black box has some of everything; the folder of the flight."""
    before = set(flights.iterdir())
    rig.start_service()
    rig.await_state(GateState.READY)
    assert rig.operator.command(Action.ENGAGE).startswith("accepted")
    rig.await_state(GateState.SERVO)
    (folder,) = set(flights.iterdir()) - before

    def streams():
        return {record["stream"] for record in read_lines(folder / "telemetry-000.jsonl")}

    assert wait_until(lambda: streams() == {"state", "servo", "timing", "route"}, 60.0)
    assert wait_until(lambda: "SERVO" in (folder / "gate.jsonl").read_text(), 60.0)
    thumbnails = folder / "thumbnails"
    assert wait_until(lambda: thumbnails.exists() and len(list(thumbnails.iterdir())) >= 2, 60.0)
    return folder


def command(capsys, *words):
    capsys.readouterr()
    assert main(list(words)) == 0
    return capsys.readouterr().out


def opened(capsys, flights, folder, tmp_path):
    """The flight's page, its exported files, and what a replay of its gate says."""
    assert wait_until(lambda: not is_running(folder), 60.0)
    listed = json.loads(command(capsys, "flights", "--folder", str(flights), "--json"))
    assert folder.name in [flight["name"] for flight in listed]
    target = tmp_path / "flight.zip"
    words = ("--folder", str(flights), "export", folder.name, str(target))
    command(capsys, "flights", *words)
    with zipfile.ZipFile(target) as archive:
        archive.extractall(tmp_path)
    exported = tmp_path / folder.name
    words = ("replay-gate", str(exported / "gate-inputs.jsonl"), "--json")
    replayed = json.loads(command(capsys, *words))
    assert replayed["difference"] == ""
    page = next(flight for flight in listed if flight["name"] == folder.name)
    return page, exported, replayed


def check_records(exported, goal):
    """What every flight must hold."""
    assert (cv2.imread(str(exported / "goal.png")) == cv2.imread(str(goal))).all()
    assert json.loads((exported / "settings.json").read_text())["vehicle"]["name"] == "faults"
    assert json.loads((exported / "build.json").read_text())["versions"]["python"]
    for view in (exported / "thumbnails").iterdir():
        image = cv2.imread(str(view))
        assert image.shape[1] == 240
        assert np.ptp(image) > 10


def check_report(exported, folder):
    """The report of a flight has everything; its page."""
    page = folder / "flight.html"
    assert report([str(exported), "--out", str(page)]) == 0
    text = page.read_text()
    assert "Nothing was recorded" not in text
    assert "data:video/webm" in text
    assert cv2.VideoCapture(str(folder / "flight.webm")).read()[0]
    return text


def test_a_service_that_is_killed_with_all_its_processes(rig, flights, capsys, tmp_path):
    folder = fly(rig, flights)
    pids = [rig.service.pid(name) for name in ("parent", *CHILDREN)]
    killed_ns = time.monotonic_ns()
    for pid in pids:
        os.kill(pid, signal.SIGKILL)
    rig.service.process.wait()
    page, exported, replayed = opened(capsys, flights, folder, tmp_path)
    assert page["status"] == "cut off"
    assert page["verdict"].startswith("cut off in SERVO")
    assert [change["state"] for change in page["states"]][-1] == "SERVO"
    check_records(exported, rig.folder / "goal.png")
    # What was kept is what the gate wrote, byte for byte, up to shortly before the end.
    kept = (exported / "gate-inputs.jsonl").read_bytes()
    assert (rig.service.runtime / "gate-inputs.jsonl").read_bytes().startswith(kept)
    assert kept.endswith(b"\n")
    assert replayed["steps"] == kept.count(b"\n") - 1
    last_ns = json.loads(kept.splitlines()[-1])["t"]
    assert killed_ns - last_ns < LATENESS_S * S
    assert "Cut off in SERVO" in check_report(exported, tmp_path)


@pytest.mark.parametrize(
    ("name", "verdict"),
    [
        ("parent", "ended in ABORT: "),
        ("gate", "the gate was killed by SIGKILL; the autopilot's failsafe has the vehicle"),
        ("perception", "ended in ABORT: "),
        ("operator_link", "ended in ABORT: "),
    ],
)
def test_a_service_of_which_one_process_is_killed(name, verdict, rig, flights, capsys, tmp_path):
    folder = fly(rig, flights)
    os.kill(rig.service.pid(name), signal.SIGKILL)
    rig.service.process.wait(60.0)
    page, exported, replayed = opened(capsys, flights, folder, tmp_path)
    assert (page["status"], page["exit_code"]) == ("ended", 1)
    assert page["verdict"].startswith(verdict)
    check_records(exported, rig.folder / "goal.png")
    # Whatever the gate wrote is there, to the last line.
    assert (exported / "gate-inputs.jsonl").read_bytes() == whole_lines(
        rig.service.runtime / "gate-inputs.jsonl"
    )
    assert replayed["steps"] > 50
    if name in ("parent", "gate"):  # one report of each verdict
        text = check_report(exported, tmp_path)
        assert verdict[0].upper() + verdict[1:] in html.unescape(text)


def test_a_flight_goes_on_without_its_black_box_and_says_so(rig, flights, capsys, tmp_path):
    folder = fly(rig, flights)
    os.kill(rig.service.pid("flights"), signal.SIGKILL)
    # A late frame may hold the vehicle for a moment; no flight that ended comes back to SERVO.
    told = "warning: the black box was killed by SIGKILL; no more of this flight is kept"
    assert wait_until(lambda: told in rig.service.errors(), 60.0)
    rig.await_state(GateState.SERVO)
    page, exported, _ = opened(capsys, flights, folder, tmp_path)
    assert page["status"] == "cut off"
    check_records(exported, rig.folder / "goal.png")
    rig.await_state(GateState.SERVO)


def whole_lines(path):
    data = path.read_bytes()
    return data[: data.rfind(b"\n") + 1]
