"""The demo beside a vehicle that runs already, and with two vehicles at a time."""

import itertools
import json
import subprocess
import sys
import time

import pytest
from real_time import flown_in_time
from vehicle_process import vehicle_running

from dfvs_sim.ground.link import GroundLink
from dfvs_sim.ground.pilot import Pilot
from dfvs_sim.vehicle.record import read_record

FLIGHT_S = 280


def command(folder, *words):
    return [sys.executable, "-m", "dfvs_sim.demo.cli", "--out", str(folder), *words]


def demo(folder, *words):
    return subprocess.run(
        command(folder, *words), capture_output=True, text=True, timeout=FLIGHT_S, check=False
    )


def beside_a_flying_vehicle(folder):
    """What the demo did with a vehicle that an earlier run left in the air."""
    options = ("--ready-after", "0.5", "--estimate", "low", "--system-id", "7")
    with vehicle_running(folder, *options) as vehicle:
        ground = f"udpin://127.0.0.1:{vehicle.ground_port}"
        with GroundLink(ground) as link:
            pilot = Pilot(link)
            pilot.prepare()
            pilot.take_off(1.0)
        links = ("--autopilot", f"udpin://127.0.0.1:{vehicle.companion_port}", "--ground", ground)
        done = demo(folder / "flight", *links, "--service", "--engage auto")
        return done, vehicle.events("state"), vehicle.events("mode_command")


@pytest.fixture(scope="module")
def beside(tmp_path_factory):
    def fly(attempt):
        return beside_a_flying_vehicle(tmp_path_factory.mktemp(f"beside-{attempt}"))

    return flown_in_time(fly, lambda flown: flown[0].returncode == 0)


@pytest.mark.slow
def test_a_service_that_engages_by_itself_is_flown_with(beside):
    done, _, commands = beside
    assert done.returncode == 0, done.stderr
    of_the_pilot = [e for e in commands if e["sysid"] == 255]
    assert not any(e["mode"] == "OFFBOARD" for e in of_the_pilot)


@pytest.mark.slow
def test_a_vehicle_that_flies_already_is_landed_first_and_another_s_is_landed_last(beside):
    done, states, _ = beside
    assert "flies already" in done.stderr
    armed = [event["armed"] for event in states]
    changes = [now for before, now in itertools.pairwise(armed) if now != before]
    assert changes[-3:] == [False, True, False]  # landed, flown, landed
    assert states[-1]["landed"]


@pytest.fixture(scope="module")
def fleet(tmp_path_factory):
    """Two vehicles at a time."""

    def fly(attempt):
        folder = tmp_path_factory.mktemp(f"fleet-{attempt}")
        words = ("--vehicles", "2", "--estimate", "low", "--json", str(folder / "all.json"))
        return demo(folder / "flight", *words), folder

    return flown_in_time(fly, lambda flown: flown[0].returncode == 0)


@pytest.mark.slow
def test_two_vehicles_converge_and_the_table_shows_both(fleet):
    done, folder = fleet
    assert done.returncode == 0, done.stderr
    assert done.stdout.splitlines()[-1] == "2 of 2 converged"
    documents = json.loads((folder / "all.json").read_text())
    assert [d["vehicle"] for d in documents] == ["demo-1", "demo-2"]
    assert [d["seed"] for d in documents] == [0, 1]


@pytest.mark.slow
def test_they_fly_at_the_same_time_under_ids_of_their_own(fleet):
    _, folder = fleet
    flights = [folder / "flight" / f"vehicle-{k}" / "vehicle.jsonl" for k in (1, 2)]
    spans = []
    for record in flights:
        flown = [e["t_ns"] for e in read_record(record) if e.get("mode") == "OFFBOARD"]
        spans.append((min(flown), max(flown)))
    (a0, a1), (b0, b1) = spans
    assert min(a1, b1) - max(a0, b0) > 2_000_000_000


@pytest.mark.slow
@pytest.mark.parametrize("words", [(), ("--vehicles", "2")])
def test_a_demo_that_is_terminated_leaves_no_vehicle_behind(tmp_path, words):
    folder = tmp_path / "flight"
    process = subprocess.Popen(command(folder, *words), stderr=subprocess.PIPE, text=True)
    for line in process.stderr:
        if "takes off" in line:
            break
    process.terminate()
    process.communicate(timeout=40)
    assert process.returncode == 143  # 128 and SIGTERM
    records = list(folder.rglob("vehicle.jsonl"))
    sizes = [record.stat().st_size for record in records]
    time.sleep(0.5)
    assert records
    assert [record.stat().st_size for record in records] == sizes
