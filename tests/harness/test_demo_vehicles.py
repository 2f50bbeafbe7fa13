"""The demo beside a vehicle that flies, with two vehicles, and with a goal out of sight."""

import itertools
import json
import math

import pytest
from pymavlink.dialects.v20 import development as mavlink
from real_time import SHARED, demo_command, flown_in_time, ran, summaries
from vehicle_process import vehicle_running
from waiting import until

from dfvs_sim.ground.link import GroundLink
from dfvs_sim.ground.pilot import Pilot
from dfvs_sim.vehicle.record import read_record

pytestmark = [pytest.mark.slow, pytest.mark.timeout(900)]
A_SHORT_WAY = ("--start=0.3,-1.25,-1.25,49", "--goal=0.5,-1,-1.3,40")
"""A third of a metre, and 9 degrees."""


def beside_a_flying_vehicle(folder):
    """What the demo did with a vehicle that an earlier run left in the air."""
    options = ("--ready-after", "0.5", "--estimate", "low", "--system-id", "7")
    with vehicle_running(folder, *options) as vehicle:
        ground = f"udpin://127.0.0.1:{vehicle.ground_port}"
        with GroundLink(ground) as link:
            pilot = Pilot(link)
            pilot.prepare()
            pilot.arm()
            home = link.wait_for("HOME_POSITION", 15.0)
            height_m = home.altitude / 1000.0 + 0.5
            link.command(mavlink.MAV_CMD_NAV_TAKEOFF, *[math.nan] * 6, height_m)
            assert until(pilot.is_flying)
        links = ("--autopilot", f"udpin://127.0.0.1:{vehicle.companion_port}", "--ground", ground)
        words = (*links, "--service", "--engage auto", "--no-report", *SHARED)
        done = ran(demo_command(folder / "flight", *words, *A_SHORT_WAY))
        return done, vehicle.events("state"), vehicle.events("mode_command")


@pytest.mark.paired
def test_a_vehicle_that_flies_already_is_landed_flown_by_its_own_engaging_and_landed(tmp_path):
    (done, states, commands), _ = flown_in_time(beside_a_flying_vehicle, tmp_path)
    assert "flies already" in done.stderr
    of_the_pilot = [e for e in commands if e["sysid"] == 255]
    assert not any(e["mode"] == "OFFBOARD" for e in of_the_pilot)
    armed = [event["armed"] for event in states]
    changes = [now for before, now in itertools.pairwise(armed) if now != before]
    assert changes[-3:] == [False, True, False]  # landed, flown, landed
    assert states[-1]["landed"]


@pytest.mark.serial
def test_two_vehicles_fly_at_the_same_time_and_the_table_shows_both(tmp_path):
    def fly(folder):
        words = ("--vehicles", "2", "--estimate", "low", "--json", folder / "all.json")
        return ran(demo_command(folder / "flight", *words, "--no-report"))

    done, folder = flown_in_time(fly, tmp_path, flights=2)
    documents = json.loads((folder / "all.json").read_text())
    assert documents == summaries(folder)
    assert [d["vehicle"] for d in documents] == ["demo-1", "demo-2"]
    assert [d["seed"] for d in documents] == [0, 1]
    converged = [d["converged"] for d in documents]
    assert done.stdout.splitlines()[-1] == f"{sum(converged)} of 2 converged"
    assert done.returncode == (0 if all(converged) else 1)
    spans = []
    for record in sorted(folder.rglob("vehicle.jsonl")):
        flown = [e["t_ns"] for e in read_record(record) if e.get("mode") == "OFFBOARD"]
        spans.append((min(flown), max(flown)))
    (a0, a1), (b0, b1) = spans
    assert min(a1, b1) - max(a0, b0) > 2_000_000_000
    left = {path.name for path in (folder / "flight" / "vehicle-1").iterdir()}
    assert "summary.json" in left
    assert not left & {"record", "report.html", "flight.webm"}  # as --no-report says


@pytest.mark.real_time
def test_a_goal_that_is_nowhere_in_sight_is_never_flown_to(tmp_path):
    """The goal looks the other way: the service stays in PREFLIGHT and says why."""
    words = ("--start=0,0,-1.3,0", "--goal=0,0,-1.3,180", "--estimate", "low", "--ready", "12")
    done = ran(demo_command(tmp_path, *words))
    assert done.returncode == 2
    assert "PREFLIGHT" in done.stderr
    assert "goal" in done.stderr
    record = read_record(tmp_path / "vehicle.jsonl")
    assert not [e for e in record if e["kind"] == "setpoint" and any(e["velocity"])]
