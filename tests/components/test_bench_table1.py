"""``dfvs-bench``: a small table from tasks to files, its plots, and what it refuses."""

import csv
import json

import numpy as np
import pytest

from dfvs_core.camera import CameraModel
from dfvs_core.poses import make_pose, so3_exp
from dfvs_sim.bench.results import read_records
from dfvs_sim.bench.task import BenchTask, read_tasks, write_tasks
from dfvs_sim.bench_cli import main
from dfvs_sim.scene import builtin_room_path
from dfvs_sim.scene.frames import gltf_pose_from_ned
from dfvs_sim.scene.poses import camera_pose

CAMERA = CameraModel.from_horizontal_fov(160, 120, np.radians(75))
GOAL = camera_pose((0.5, -1.0, -1.3), np.radians(40))


def bench_task(name, distance_m, angle_deg):
    away = make_pose(so3_exp(np.array([0.0, np.radians(angle_deg), 0.0])), [0, 0, -distance_m])
    return BenchTask(name, builtin_room_path(), GOAL @ away, GOAL, CAMERA, "easy")


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    """A folder with a task file and what ``table1`` made of it."""
    folder = tmp_path_factory.mktemp("bench")
    write_tasks(folder / "tasks.json", [bench_task("near", 0.02, 1.0), bench_task("far", 0.5, 9)])
    assert table1(folder) == 0
    return folder


def table1(folder, *more):
    words = ["--tasks", str(folder / "tasks.json"), "--methods", "true-depth,photometric"]
    files = ["--json", str(folder / "t.json"), "--csv", str(folder / "t.csv")]
    words += ["--runs", str(folder / "runs"), "--iterations", "14", *files, *more]
    return main(["table1", *words])


def test_the_summary_counts_what_converged(folder):
    methods = json.loads((folder / "t.json").read_text())["methods"]
    ours = methods["true-depth"]
    assert (ours["scenes"], ours["converged"]) == (2, 1)  # fourteen steps are few from afar
    near, far = ours["per_scene"]["near"], ours["per_scene"]["far"]
    assert near["converged"]
    assert not far["converged"]
    assert far["iterations"] == 14
    assert far["iterations_to_criterion"] is None
    assert far["initial_translation_m"] == pytest.approx(0.5)
    assert far["translation_m"] < 0.3
    assert ours["mean_translation_m"] == near["translation_m"]
    assert methods["photometric"]["per_scene"]["near"]["converged"]


def test_the_table_has_a_row_for_every_trial(folder):
    with (folder / "t.csv").open() as file:
        rows = list(csv.DictReader(file))
    keys = [(row["method"], row["task"]) for row in rows]
    methods, tasks = ("true-depth", "photometric"), ("near", "far")
    assert keys == [(method, task) for method in methods for task in tasks]
    assert all(row["version"] and row["revision"] for row in rows)


def test_a_run_is_taken_up_where_it_broke_off(folder, capsys):
    (record,) = (folder / "runs").glob("near--true-depth.json")
    others = {path: path.stat().st_mtime_ns for path in (folder / "runs").iterdir()}
    before = json.loads(record.read_text())["trial"]
    record.unlink()
    assert table1(folder, "--resume") == 0
    assert "3 trials are in" in capsys.readouterr().err
    assert json.loads(record.read_text())["trial"] == before
    others.pop(record)
    assert all(path.stat().st_mtime_ns == then for path, then in others.items())


def test_trials_become_plots_and_a_page(folder):
    runs = ["--runs", str(folder / "runs")]
    plot, page = folder / "far.png", folder / "report.html"
    assert main(["controller", *runs, "--scene", "far", "--out", str(plot)]) == 0
    assert plot.read_bytes().startswith(b"\x89PNG")
    tasks = ["--tasks", str(folder / "tasks.json")]
    tasks += ["--basin", str(folder / "none"), "--drone", str(folder / "none")]
    assert main(["report", *runs, *tasks, "--out", str(page)]) == 0
    text = page.read_text()
    assert "1 of 2" in text
    assert "src='http" not in text
    assert "Basin" not in text
    assert "Flights" not in text
    assert text.count("data:image/jpeg") == 2 * (2 + 2)


def test_a_task_file_keeps_its_poses(folder):
    (near, far) = read_tasks(folder / "tasks.json")
    assert (near.name, far.name) == ("near", "far")
    np.testing.assert_allclose(far.T_world_goal, GOAL, atol=1e-12)
    np.testing.assert_allclose(far.T_world_start, bench_task("far", 0.5, 9).T_world_start)
    entry = json.loads((folder / "tasks.json").read_text())["tasks"][0]
    np.testing.assert_allclose(entry["goal"], gltf_pose_from_ned(GOAL))
    assert len(read_records(folder / "runs")) == 4


@pytest.mark.parametrize(
    ("change", "words"),
    [
        ({"goal": [[1, 0], [0, 1]]}, "four rows"),
        ({"scene": "nowhere.glb"}, "no scene"),
        ({"colour": "red"}, "unknown key"),
        ({"start": (2 * np.eye(4)).tolist()}, "not orthonormal"),
    ],
)
def test_a_wrong_task_is_one_line_and_exit_code_2(folder, tmp_path, capsys, change, words):
    document = json.loads((folder / "tasks.json").read_text())
    document["tasks"][0].update(change)
    (tmp_path / "tasks.json").write_text(json.dumps(document))
    assert main(["table1", "--tasks", str(tmp_path / "tasks.json")]) == 2
    error = capsys.readouterr().err
    assert error.startswith("error: ")
    assert words in error
    assert error.count("\n") == 1


def test_an_unknown_method_or_scene_is_refused(folder, capsys):
    assert main(["table1", "--methods", "magic"]) == 2
    assert "true-depth" in capsys.readouterr().err
    assert table1(folder, "--scenes", "moon") == 2
    assert "near, far" in capsys.readouterr().err
