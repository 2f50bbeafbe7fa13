"""``dfvs-bench``: a small table from tasks to files, its plots, and what it refuses."""

import csv
import json
import subprocess
from dataclasses import replace

import cv2
import numpy as np
import pose_bundle
import pytest
from depth_bundle import bundle
from onnx_network import write_bundle

from dfvs_bench.cli import main
from dfvs_bench.methods.registry import DEFAULT_METHODS, POSE_NETWORKS, with_bundles
from dfvs_bench.trials import provenance
from dfvs_bench.trials.results import fits, read_records
from dfvs_bench.trials.scenes import default_tasks
from dfvs_bench.trials.settings import wall
from dfvs_bench.trials.tables import row
from dfvs_bench.trials.task import BenchTask, read_tasks, write_tasks
from dfvs_core.geometry.camera import CameraModel
from dfvs_core.geometry.poses import make_pose, so3_exp
from dfvs_core.messages.schema import dump
from dfvs_sim.render.renderer import Renderer
from dfvs_sim.scene import builtin_room_path
from dfvs_sim.scene.frames import gltf_pose_from_ned
from dfvs_sim.viewpoints.poses import camera_pose

CAMERA = CameraModel.from_horizontal_fov(160, 120, np.radians(75))
GOAL = camera_pose((0.5, -1.0, -1.3), np.radians(40))
OTHER_GOAL = camera_pose((-0.5, 0.6, -1.2), np.radians(-60))
TABLE1 = ("table1", "--bundle", "classical")


def bench_task(name, distance_m, angle_deg, goal=GOAL):
    away = make_pose(so3_exp(np.array([0.0, np.radians(angle_deg), 0.0])), [0, 0, -distance_m])
    return BenchTask(name, builtin_room_path(), goal @ away, goal, CAMERA, "easy", 7)


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    """A folder with a task file and what ``table1`` made of it."""
    folder = tmp_path_factory.mktemp("bench")
    tasks = [bench_task("near", 0.02, 1.0), bench_task("far", 0.5, 9)]
    write_tasks(folder / "tasks.json", [*tasks, bench_task("turned", 0.05, 3, OTHER_GOAL)])
    assert table1(folder) == 0
    return folder


def table1(folder, *more):
    words = ["--tasks", str(folder / "tasks.json"), "--methods", "true-depth,photometric"]
    files = ["--json", str(folder / "t.json"), "--csv", str(folder / "t.csv")]
    words += ["--runs", str(folder / "runs"), "--iterations", "14", *files, *more]
    return main([*TABLE1, *words])


def one_row(folder, runs, method, *more):
    """Record of a method in the near task."""
    words = ["--tasks", str(folder / "tasks.json"), "--methods", method, "--scenes", "near"]
    assert main([*TABLE1, *words, "--runs", str(runs), "--iterations", "2", *more]) == 0
    (record,) = read_records(runs)
    return record


def test_a_row_by_a_depth_network_is_made_with_its_bundle(folder, tmp_path):
    depth = write_bundle(tmp_path / "depth", bundle(np.full((60, 80), 0.5)))
    record = one_row(folder, tmp_path / "runs", "fused-depth", "--depth-bundle", str(depth))
    task = read_tasks(folder / "tasks.json")[0]
    made_of = task, record.matcher, record.most_iterations
    assert record.network == row(record)["network"] == str(depth)
    assert fits(record, *made_of, str(depth))
    other = write_bundle(tmp_path / "other", bundle(np.full((60, 80), 0.4)))
    assert not fits(record, *made_of, str(other))
    assert not fits(record, *made_of)


def test_rows_by_a_network_are_left_out_where_there_is_none():
    bundles = dict.fromkeys(("depth", *POSE_NETWORKS), "nowhere")
    assert set(DEFAULT_METHODS) - set(with_bundles(DEFAULT_METHODS, bundles)) == {
        "network-depth",
        "fused-depth",
        "fused-depth-late",
        "fused-depth-late-medium",
        "saxena",
        "bateux",
    }


def test_a_row_by_a_regressed_pose_is_made_with_its_bundle(folder, tmp_path):
    made = write_bundle(tmp_path / "pose", pose_bundle.bundle((0, 0, 0), (0, 0, 0), "depth"))
    record = one_row(folder, tmp_path / "runs", "bateux", "--bateux-bundle", str(made))
    assert record.trial.iterations == 2


def test_settings_of_pose_regression_are_written_as_tasks(tmp_path):
    words = ["--setting", "near", "--out", str(tmp_path / "near"), "--share", "0.1"]
    assert main(["scenes", *words]) == 0
    near = read_tasks(tmp_path / "near" / "tasks.json")
    for task, whole in zip(near, default_tasks(), strict=True):
        np.testing.assert_allclose(task.T_world_goal, whole.T_world_goal, atol=1e-9)
        assert task.initial_error[1] == pytest.approx(0.1 * whole.initial_error[1], rel=1e-3)


def test_a_wall_shows_its_photograph_to_who_looks_straight_at_it():
    photograph = np.random.default_rng(0).integers(0, 255, (12, 16, 3), dtype=np.uint8)
    large = cv2.resize(photograph, (320, 240), interpolation=cv2.INTER_CUBIC)
    view = Renderer(wall(large)).render(
        CameraModel.from_horizontal_fov(320, 240, np.pi / 2), camera_pose((0.0, 0.0, 0.0), 0.0)
    )
    assert np.abs(view.image.astype(int) - large)[4:-4, 4:-4].mean() < 4.0
    np.testing.assert_allclose(view.depth_m, 2.0, atol=1e-4)


def test_every_trial_has_a_row_and_the_summary_counts_what_converged(folder):
    document = json.loads((folder / "t.json").read_text())
    methods = document["methods"]
    ours = methods["true-depth"]
    assert (ours["scenes"], ours["converged"]) == (3, 2)  # fourteen steps are few from afar
    near, far = ours["per_scene"]["near"], ours["per_scene"]["far"]
    assert near["converged"]
    assert not far["converged"]
    assert far["iterations"] == 14
    assert far["iterations_to_criterion"] is None
    assert far["initial_translation_m"] == pytest.approx(0.5)
    assert far["translation_m"] < 0.3
    good = (near["translation_m"], ours["per_scene"]["turned"]["translation_m"])
    assert ours["mean_translation_m"] == pytest.approx(np.mean(good), abs=1e-5)
    assert methods["photometric"]["per_scene"]["near"]["converged"]
    assert document["wall_s"] > 0
    assert document["revisions"] == [document["made_with"]["revision"]]
    with (folder / "t.csv").open() as file:
        rows = list(csv.DictReader(file))
    keys = [(row["method"], row["task"]) for row in rows]
    names, tasks = ("true-depth", "photometric"), ("near", "far", "turned")
    assert keys == [(name, task) for name in names for task in tasks]
    assert all(row["version"] and row["revision"] and row["inputs"] for row in rows)
    assert {row["seed"] for row in rows} == {"7"}


def test_a_run_is_taken_up_where_it_broke_off(folder, capsys):
    (record,) = (folder / "runs").glob("near--true-depth.json")
    others = {path: path.stat().st_mtime_ns for path in (folder / "runs").iterdir()}
    before = json.loads(record.read_text())["trial"]
    record.unlink()
    assert table1(folder, "--resume") == 0
    assert "5 trials are in" in capsys.readouterr().err
    assert json.loads(record.read_text())["trial"] == before
    others.pop(record)
    assert all(path.stat().st_mtime_ns == then for path, then in others.items())


def test_perturbed_trials_stand_beside_those_without(folder, tmp_path, capsys):
    words = ["--tasks", str(folder / "tasks.json"), "--methods", "photometric", "--scenes", "near"]
    words += ["--runs", str(tmp_path / "runs"), "--json", str(tmp_path / "t.json")]
    words += ["--iterations", "14", "--perturb", "noise-mild,occlusion-strong"]
    assert main([*TABLE1, *words]) == 0
    table = capsys.readouterr().out
    summary = json.loads((tmp_path / "t.json").read_text())
    without = summary["methods"]["photometric"]
    perturbed = {name: s["methods"]["photometric"] for name, s in summary["perturbed"].items()}
    assert without["converged"] == 1
    converged = [(name, s["converged"]) for name, s in perturbed.items()]
    assert converged == [("occlusion-strong", 0), ("noise-mild", 1)]
    assert "photometric 1 of 1 0 of 1 1 of 1 1 of 2" in " ".join(table.split())
    near = without["per_scene"]["near"]
    share = near["translation_m"] / near["median_depth_m"]
    assert near["translation_over_depth"] == pytest.approx(share, rel=0.1)
    assert main([*TABLE1, *words, "--resume"]) == 0
    assert "3 trials are in" in capsys.readouterr().err


def report(page, runs, *more):
    """The report of trials alone: without starts that were drawn, or flights."""
    none = str(page.parent / "none")
    words = ["--runs", str(runs), "--basin", none, "--drone", none, "--out", str(page)]
    assert main(["report", *words, *more]) == 0
    return page.read_text()


def test_trials_become_plots_and_a_page(folder):
    runs, plot = folder / "runs", folder / "far.png"
    words = ["--runs", str(runs), "--scene", "far", "--out", str(plot)]
    assert main(["controller", *words]) == 0
    assert plot.read_bytes().startswith(b"\x89PNG")
    text = report(folder / "report.html", runs, "--tasks", str(folder / "tasks.json"))
    assert "2 of 3" in text
    assert "src='http" not in text
    assert "Basin" not in text
    assert "Flights" not in text
    assert text.count("data:image/jpeg") == 3 * (2 + 2)
    assert text.count("data:image/svg") == 1 + 3  # depth, and a controller for every task
    assert "that by the network <code>dfvs-depth</code>" in text


def test_a_task_file_keeps_its_poses(folder):
    near, far, _ = read_tasks(folder / "tasks.json")
    assert (near.name, far.name) == ("near", "far")
    np.testing.assert_allclose(far.T_world_goal, GOAL, atol=1e-12)
    np.testing.assert_allclose(far.T_world_start, bench_task("far", 0.5, 9).T_world_start)
    entry = json.loads((folder / "tasks.json").read_text())["tasks"][0]
    np.testing.assert_allclose(entry["goal"], gltf_pose_from_ned(GOAL))
    assert len(read_records(folder / "runs")) == 6


def test_poses_that_were_rounded_and_scenes_beside_the_shell_are_taken(
    folder, tmp_path, monkeypatch
):
    document = json.loads((folder / "tasks.json").read_text())
    entry = document["tasks"][1]
    entry["scene"] = "room.glb"
    for name in ("start", "goal"):
        entry[name] = np.round(entry[name], 3).tolist()
    (tmp_path / "tasks.json").write_text(json.dumps([entry]))
    (tmp_path / "here").mkdir()
    (tmp_path / "here" / "room.glb").write_bytes(builtin_room_path().read_bytes())
    monkeypatch.chdir(tmp_path / "here")
    (task,) = read_tasks(tmp_path / "tasks.json")
    assert task.scene == tmp_path / "here" / "room.glb"
    R = task.T_world_goal[:3, :3]
    np.testing.assert_allclose(R @ R.T, np.eye(3), atol=1e-12)
    np.testing.assert_allclose(task.T_world_goal, GOAL, atol=2e-3)


def test_a_report_takes_anybody_s_scene_and_leaves_out_what_is_empty(tmp_path):
    scene = tmp_path / "lab.glb"
    scene.write_bytes(builtin_room_path().read_bytes())
    words = ["--scene", str(scene), "--methods", "photometric", "--iterations", "1"]
    assert main([*TABLE1, *words, "--runs", str(tmp_path / "runs")]) == 0
    (tmp_path / "empty").mkdir()
    more = ("--scene", str(scene), "--basin", str(tmp_path / "empty"))
    text = report(tmp_path / "lab.html", tmp_path / "runs", *more)
    assert "the scenes are other ones" in text
    assert "<code>photometric</code>, run here" in text


def test_a_plot_of_an_unknown_method_is_refused(folder, refused):
    words = ["--runs", folder / "runs", "--scene", "far", "--out", folder / "no.png"]
    assert "magic" in refused(main, "controller", *words, "--methods", "photometric,magic")


def test_a_copy_in_somebody_else_s_repository_has_no_revision(tmp_path, monkeypatch):
    subprocess.run(["git", "init", "-q", str(tmp_path)], check=True)
    (tmp_path / "provenance.py").touch()
    monkeypatch.setattr(provenance, "__file__", str(tmp_path / "provenance.py"))
    assert provenance.git_revision() == "unknown"


def test_trials_of_other_inputs_are_not_taken_for_these(folder):
    task = read_tasks(folder / "tasks.json")[0]
    record = next(
        r for r in read_records(folder / "runs") if (r.task, r.method) == ("near", "true-depth")
    )
    assert fits(record, task, record.matcher, record.most_iterations)
    wider = CameraModel.from_horizontal_fov(160, 120, np.radians(80))
    assert not fits(record, replace(task, camera=wider), record.matcher, record.most_iterations)
    assert not fits(record, task, "dfvs-flow", record.most_iterations)
    reseeded = replace(task, seed=2)
    assert fits(record, reseeded, record.matcher, record.most_iterations)
    perturbed = replace(record, perturbation="light-medium")
    assert fits(perturbed, task, record.matcher, record.most_iterations)
    assert not fits(perturbed, reseeded, record.matcher, record.most_iterations)


@pytest.mark.parametrize(
    ("change", "words"),
    [
        ({"goal": [[1, 0], [0, 1]]}, "four rows"),
        ({"scene": "nowhere.glb"}, "no scene"),
        ({"colour": "red"}, "unknown key"),
        ({"start": (2 * np.eye(4)).tolist()}, "not orthonormal"),
        ({"name": ".."}, "names of their own"),
        ({"name": "x" * 101}, "names of their own"),
        ({"intrinsics": dump(CameraModel(31, 40, 20.0, 20.0, 16.0, 20.0))}, "32 x 32 or more"),
        ({"start": [*np.eye(4)[:3].tolist(), [0.5, 1, 2, 1]]}, "transposed"),
    ],
)
def test_a_wrong_task_is_one_line_and_exit_code_2(folder, tmp_path, refused, change, words):
    document = json.loads((folder / "tasks.json").read_text())
    document["tasks"][0].update(change)
    (tmp_path / "tasks.json").write_text(json.dumps(document))
    given = [*TABLE1, "--methods", "photometric", "--tasks", tmp_path / "tasks.json"]
    assert words in refused(main, *given)
