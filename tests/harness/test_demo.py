"""The demo as a user runs it: every process, the real links, one flight."""

import json
import math
import sys

import cv2
import numpy as np
import pytest
from built_in_room import built_in_room
from real_time import SHARED, demo_command, flown_in_time, ran

from dfvs_core.geometry.camera import CameraModel
from dfvs_sim.demo.plan import make_plan
from dfvs_sim.vehicle.record import read_record

pytestmark = [pytest.mark.paired, pytest.mark.slow, pytest.mark.timeout(900)]


@pytest.fixture(scope="module")
def flight(tmp_path_factory):
    """One flight, recorded, and what it left behind."""

    def fly(folder):
        words = ("--seed", "0", "--estimate", "low", *SHARED)
        files = ("--json", folder / "figures.json", "--service", f"--record {folder / 'record'}")
        return ran(demo_command(folder / "flight", *words, *files))

    done, folder = flown_in_time(fly, tmp_path_factory.mktemp("demo"))
    return done, folder / "flight", json.loads((folder / "figures.json").read_text())


def events(folder, kind):
    return [e for e in read_record(folder / "vehicle.jsonl") if e["kind"] == kind]


def test_it_flies_to_the_goal_and_says_so(flight):
    done, _, summary = flight
    final_m, final_deg = summary["final_translation_m"], summary["final_rotation_deg"]
    assert summary["converged"] == (final_m < 0.05 and final_deg < 1.0)
    assert done.returncode == (0 if summary["converged"] else 1)
    assert summary["initial_translation_m"] > 0.8
    assert summary["initial_rotation_deg"] > 20
    assert summary["path_ratio"] <= 2.0
    assert summary["states"][-1] == "DONE"
    assert (summary["estimate"], summary["wind"]) == ("low", "calm")


def test_it_leaves_a_report_a_film_and_a_summary_and_names_them(flight):
    done, folder, summary = flight
    assert "report.html, flight.webm and summary.json in" in done.stderr
    assert json.loads((folder / "summary.json").read_text()) == summary
    page = (folder / "report.html").read_text()
    assert "The goal was reached." in page
    assert "true, of the simulation" in page
    assert "Nothing was recorded." not in page
    assert "No flow is drawn" not in page
    assert "The flow is computed again, by another build" not in page
    film = cv2.VideoCapture(str(folder / "flight.webm"))
    seconds = film.get(cv2.CAP_PROP_FRAME_COUNT) / film.get(cv2.CAP_PROP_FPS)
    assert seconds > summary["duration_s"]


def test_the_vehicle_took_off_from_the_scene_s_floor(flight):
    """Its ground is the built-in room's floor, 0 m in the scene; it starts where it was drawn."""
    _, folder, _ = flight
    poses = events(folder, "pose")
    first = next(e for e in poses if e["mode"] == "OFFBOARD")
    climb_m = poses[0]["position"][2] - first["position"][2]
    room, camera = (
        built_in_room(),
        CameraModel(320, 240, 209, 209, 160, 120),
    )
    start_m = -make_plan(room, camera, 0, None, ()).T_scene_start[2, 3]
    assert climb_m == pytest.approx(start_m, abs=0.1)  # 0.05 m/s of rest, 1 s and more before


def test_its_recording_gives_the_same_commands_bit_for_bit(flight):
    _, folder, summary = flight
    files = sorted((folder.parent / "record").glob("*.mcap"))
    command = [sys.executable, "-m", "dfvs_service.replay.cli", *map(str, files)]
    done = ran([*command, "--json", str(folder / "replay.json")])
    assert done.returncode == 0, done.stdout + done.stderr
    replay = json.loads((folder / "replay.json").read_text())
    assert replay["reasons_to_differ"] == []
    assert replay["is_identical"]
    assert len(replay["frames"]) >= summary["frames"] > 50


def test_the_vehicle_s_own_record_shows_setpoints_within_the_limits_and_without_pauses(flight):
    """Invariants I1 and, but for what a busy machine takes away at times, I3."""
    _, folder, summary = flight
    seen = events(folder, "setpoint")
    assert len(seen) > 200
    for event in seen:
        vx, vy, vz = event["velocity"]
        assert all(map(math.isfinite, (vx, vy, vz, event["yaw_rate_rad_s"])))
        assert math.hypot(vx, vy) <= 0.5 + 1e-6
        assert abs(vz) <= 0.3 + 1e-6
        assert abs(event["yaw_rate_rad_s"]) <= math.radians(20) + 1e-6
    gaps_ms = np.diff([event["t_ns"] for event in seen]) * 1e-6
    assert np.percentile(gaps_ms, 99) <= 150
    assert 0 < summary["max_setpoint_gap_ms"] <= round(gaps_ms.max(), 2)
    assert 0 < summary["latency_ms"]["p50"] <= summary["latency_ms"]["p99"]
