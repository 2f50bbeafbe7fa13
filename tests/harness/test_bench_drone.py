"""``dfvs-bench drone``: one task flown through the real service, and kept."""

import csv
import json

import pytest
from real_time import flown_in_time

from dfvs_bench.cli import main
from dfvs_bench.trials.task import BenchTask, write_tasks
from dfvs_core.geometry.camera import CameraModel
from dfvs_sim.scene import builtin_room_path
from dfvs_sim.viewpoints.poses import camera_pose

pytestmark = [pytest.mark.paired, pytest.mark.slow, pytest.mark.timeout(900)]
CAMERA = CameraModel.from_horizontal_fov(192, 144, 1.3)  # what slow machines compare in time, too
GOAL = (0.5, -1.0, -1.3)
TASK = BenchTask(
    "room",
    builtin_room_path(),
    camera_pose((0.3, -1.25, -1.25), 0.85, -0.08),
    camera_pose(GOAL, 0.7, 0.05),
    CAMERA,
    "easy",
)


def drone(folder, *more):
    words = ["--tasks", str(folder / "tasks.json"), "--runs", str(folder / "runs")]
    words += ["--estimate", "low", "--timeout", "120", "--ready", "90"]
    files = [f"--{name}={folder / f'd.{name}'}" for name in ("json", "csv")]
    return main(["drone", *words, *files, *more])


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    """A folder with a task, and what ``drone`` made of it."""

    def fly(folder):
        write_tasks(folder / "tasks.json", [TASK])
        return drone(folder)

    code, folder = flown_in_time(fly, tmp_path_factory.mktemp("drone"))
    assert code == 0
    return folder


def test_the_levelled_task_is_flown_and_timed_against_its_bound(folder):
    summary = json.loads((folder / "d.json").read_text())["methods"]["service"]
    flight = summary["per_scene"]["room"]
    final = flight["translation_m"], flight["rotation_deg"]
    assert flight["converged"] == (final[0] < 0.05 and final[1] < 1.0)
    assert summary["converged"] == flight["converged"]
    distance_m = flight["initial_translation_m"]  # of the hover, which drifts by some centimetres
    assert distance_m == pytest.approx(0.32404, abs=0.1)
    assert flight["bound_s"] == pytest.approx(2 * (distance_m / 0.5) ** 0.5, abs=1e-3)
    assert flight["bound_s"] < flight["done_s"]
    assert 0 < flight["servo_s"] < flight["done_s"]
    if flight["converged"]:
        assert flight["servo_s"] < flight["within_s"]
        ratio = flight["within_s"] / flight["bound_s"]
        assert summary["mean_within_ratio"] == pytest.approx(ratio, rel=1e-3)


def test_the_goal_picture_is_taken_level(folder):
    pose = json.loads((folder / "runs" / "room" / "goal.json").read_text())["pose_camera"]
    assert pose == pytest.approx(camera_pose(GOAL, 0.7).ravel().tolist(), abs=1e-9)


def test_a_flight_that_is_kept_is_not_flown_again(folder, capsys):
    flown = (folder / "runs" / "room" / "vehicle.jsonl").stat().st_mtime_ns
    assert drone(folder, "--resume") == 0
    assert (folder / "runs" / "room" / "vehicle.jsonl").stat().st_mtime_ns == flown
    told = capsys.readouterr()
    assert "1 flights are in" in told.err
    assert "of 1 converged" in told.out
    with (folder / "d.csv").open() as file:
        (row,) = csv.DictReader(file)
    assert row["revision"]
    assert row["seed"] == "0"
    assert (row["estimate"], row["wind"]) == ("low", "calm")
