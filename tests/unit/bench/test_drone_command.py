"""``dfvs-bench drone`` as a command: flights that cannot be brought up, and its options."""

import json
import math
from collections.abc import Callable
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import pytest

from dfvs_bench import cli
from dfvs_bench.commands import drone as command
from dfvs_bench.drone import flights
from dfvs_bench.drone.bound import trapezoid_s
from dfvs_bench.trials.task import BenchTask, write_tasks
from dfvs_core.errors import ConfigError, DfvsError
from dfvs_core.gate.limits import VelocityLimits
from dfvs_core.geometry.camera import CameraModel
from dfvs_core.geometry.poses import pose_error
from dfvs_sim.demo.flight.flight import Flight, NotReadyError
from dfvs_sim.demo.flight.flight_log import FlightLog
from dfvs_sim.demo.flight.track import Track, TrackPoint
from dfvs_sim.demo.options import FlightOptions
from dfvs_sim.demo.plan import FlightPlan
from dfvs_sim.ground.pilot import PilotError
from dfvs_sim.scene import builtin_room_path
from dfvs_sim.viewpoints.poses import camera_pose

CAMERA = CameraModel.from_horizontal_fov(96, 72, 1.3)
START, GOAL = camera_pose((0.3, -1.25, -1.25), 0.85), camera_pose((0.5, -1.0, -1.3), 0.7)
NAMES = ("hall", "room")
S = 10**9
PX4 = "udpin://127.0.0.1:14540"


@pytest.fixture
def fly(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Callable[..., int]:
    """Runs the command on two tasks without a matcher."""
    monkeypatch.setattr(command, "load_matcher", lambda *_, **__: None)
    tasks = [BenchTask(name, builtin_room_path(), START, GOAL, CAMERA) for name in NAMES]
    write_tasks(tmp_path / "tasks.json", tasks)
    files = "--tasks", str(tmp_path / "tasks.json"), "--runs", str(tmp_path / "runs")
    return lambda *words: cli.main(
        ["drone", *files, "--json", str(tmp_path / "drone.json"), *words]
    )


def failing(monkeypatch: pytest.MonkeyPatch, *errors: DfvsError) -> list[Flight]:
    """Have flights end with these errors, one each; returns those that have."""
    flown: list[Flight] = []

    def run(flight: Flight, _: object) -> None:
        flight._ports.close()
        flown.append(flight)
        raise errors[len(flown) - 1]

    monkeypatch.setattr(flights.Flight, "run", run)
    return flown


def test_a_flight_that_cannot_be_brought_up_does_not_end_the_others(
    fly: Callable[..., int],
    tmp_path: Path,
    monkeypatch: pytest.MonkeyPatch,
    capsys: pytest.CaptureFixture[str],
) -> None:
    errors = PilotError("arming was temporarily rejected"), NotReadyError("no goal")
    failing(monkeypatch, *errors)
    assert fly() == 1
    document = json.loads((tmp_path / "drone.json").read_text())
    rows: dict[str, Any] = document["methods"]["service"]["per_scene"]
    assert {row["end_state"] for row in rows.values()} == {"NOT READY"}
    assert [rows[name]["end_cause"] for name in NAMES] == [str(error) for error in errors]
    assert "NOT READY: arming was temporarily rejected" in capsys.readouterr().out


def test_start_bound_and_path_are_those_of_the_true_start(
    fly: Callable[..., int], tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """A second after the take-off the vehicle has drifted away from the goal."""
    places = [(0.0, -1.0, -1.3), (0.1, -1.0, -1.3), (0.45, -1.0, -1.3), (0.5, -1.0, -1.3)]
    away = [camera_pose((-0.2, -1.0, -1.3), 0.7), *(camera_pose(p, 0.65) for p in places)]

    def run(flight: Flight, _: object) -> FlightLog:
        flight._ports.close()
        plan: FlightPlan = flight._plan
        track = Track(lambda _: None, plan.T_scene_goal)
        track.points = [
            TrackPoint(k * S, T, *pose_error(T, plan.T_scene_goal)) for k, T in enumerate(away)
        ]
        watch: Any = SimpleNamespace(servo=[], timing={}, states=[(2 * S, "SERVO")])
        return FlightLog(plan, FlightOptions(), track, watch, S, 5 * S, "DONE", "", None)

    monkeypatch.setattr(flights.Flight, "run", run)
    assert fly("--scenes", "room") == 0
    document = json.loads((tmp_path / "drone.json").read_text())
    row = document["methods"]["service"]["per_scene"]["room"]
    assert row["initial_translation_m"] == pytest.approx(0.5, abs=1e-3)
    assert row["initial_rotation_deg"] == pytest.approx(math.degrees(0.05), abs=1e-3)
    assert row["path_ratio"] == pytest.approx(1.0, abs=1e-3)
    assert row["bound_way_s"] == pytest.approx(2 * (0.5 / 0.5) ** 0.5, abs=1e-3)
    assert row["bound_turn_s"] == pytest.approx(
        trapezoid_s(0.05, VelocityLimits().yaw_rad_s, VelocityLimits().yaw_slew_rad_s2), abs=1e-3
    )


def test_another_autopilot_is_flown_and_told(
    fly: Callable[..., int], tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    flown = failing(monkeypatch, PilotError("arming was denied"))
    ground = "udpout://127.0.0.1:18570"
    words = "--autopilot", PX4, "--ground", ground, "--system-id", "2", "--scenes", "room"
    assert fly(*words) == 1
    (options,) = (flight._options for flight in flown)
    assert (options.autopilot, options.ground, options.system_id) == (PX4, ground, 2)
    assert not options.is_simulated
    document = json.loads((tmp_path / "drone.json").read_text())
    row = document["methods"]["service"]["per_scene"]["room"]
    for told in (document, row):
        assert (told["autopilot"], told["estimate"], told["wind"]) == (PX4, None, None)


def test_a_summary_among_the_flights_is_refused(
    fly: Callable[..., int], tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    """``dfvs-bench report`` would take it for a flight."""
    runs = tmp_path / "runs"
    runs.mkdir()
    assert fly("--json", str(runs / "drone.json")) == 2
    assert "--json" in capsys.readouterr().err
    assert list(runs.iterdir()) == []


def test_an_error_that_every_flight_would_meet_ends_the_run(
    fly: Callable[..., int], monkeypatch: pytest.MonkeyPatch
) -> None:
    flown = failing(monkeypatch, *[ConfigError("cannot listen on UDP 127.0.0.1:14550")] * 2)
    assert fly() == 2
    assert len(flown) == 1
