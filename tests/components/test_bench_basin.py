"""``dfvs-bench basin``: from drawn starts to ratios, files and a plot."""

import csv
import json
import shutil

import pytest
from distributed import LocalCluster

from dfvs_bench.basin.outcomes import read_outcomes
from dfvs_bench.cli import main
from dfvs_bench.trials.task import BenchTask, write_tasks
from dfvs_core.geometry.camera import CameraModel
from dfvs_sim.scene import builtin_room_path
from dfvs_sim.viewpoints.poses import camera_pose

CAMERA = CameraModel(160, 120, 100, 100, 80, 60)
POSE = camera_pose((0.5, -1.0, -1.3), 0.7)
AT_HOME = {"host": "127.0.0.1", "protocol": "tcp://", "dashboard_address": None}


def basin(folder, *more):
    words = ["--tasks", str(folder / "tasks.json"), "--runs", str(folder / "runs")]
    words += ["--method", "true-depth", "--bundle", "classical", "--iterations", "40"]
    words += ["--translations", "0.2,4", "--rotations", "4,4,8", "--trials", "2"]
    files = [f"--{name}={folder / f'b.{name}'}" for name in ("json", "csv")]
    return main(["basin", *words, *files, "--plot", str(folder / "b.png"), *more])


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    """A folder with an environment, and what ``basin`` made of it."""
    folder = tmp_path_factory.mktemp("basin")
    write_tasks(folder / "tasks.json", [BenchTask("room", builtin_room_path(), POSE, POSE, CAMERA)])
    assert basin(folder) == 0
    return folder


def figures(folder, kind):
    (curves,) = json.loads((folder / "b.json").read_text())["methods"]["true-depth"][
        "sets"
    ].values()
    return curves[kind]


def test_what_starts_near_converges_and_what_starts_far_in_a_small_room_is_rare(folder):
    near, *_ = figures(folder, "overlap")["per_translation"]
    assert (near["translation_m"], near["trials"]) == (0.2, 2)
    assert near["converged"] == 2
    assert near["interval_95"][0] == pytest.approx(0.342, abs=1e-3)
    assert near["mean_overlap"] > 0.5
    assert 0.2 <= near["mean_distance_m"] <= 0.2 * 3**0.5


def test_both_ratios_stand_side_by_side(folder):
    free, overlapping = figures(folder, "all"), figures(folder, "overlap")
    assert free["trials"] >= 2
    assert overlapping["ratio"] == overlapping["converged"] / overlapping["trials"]


def test_the_table_names_seed_version_and_revision_of_every_trial(folder):
    with (folder / "b.csv").open() as file:
        rows = list(csv.DictReader(file))
    assert len(rows) == len(list((folder / "runs").glob("*--*.json")))
    for row in rows:
        assert row["environment"] == "room"
        assert row["seed"] == "0"
        assert row["version"]
        assert row["revision"]
        assert float(row["translation_per_axis_m"]) in (0.2, 4.0)
    assert (folder / "b.png").read_bytes().startswith(b"\x89PNG")


def test_a_broken_run_goes_on_with_the_same_tasks_on_a_cluster(folder, capsys):
    before = {o.drawn.name: o.record.trial for o in read_outcomes(folder / "runs")}
    missing = next((folder / "runs").glob("r4-4-8-t0.2-*.json"))
    missing.unlink()
    with LocalCluster(1, threads_per_worker=1, processes=False, **AT_HOME) as cluster:
        assert basin(folder, "--resume", "--dask", cluster.scheduler_address) == 0
    told = capsys.readouterr().err
    assert f"{len(before) - 1} trials are in" in told
    assert "[1/1" in told
    assert {o.drawn.name: o.record.trial for o in read_outcomes(folder / "runs")} == before


def test_trials_of_tasks_that_another_call_replaced_are_counted_aloud(folder, tmp_path, capsys):
    runs = shutil.copytree(folder / "runs", tmp_path / "runs")
    document = json.loads((runs / "basin.json").read_text())
    document["environments"][0]["tasks"] = document["environments"][0]["tasks"][:1]
    (runs / "basin.json").write_text(json.dumps(document))
    assert len(read_outcomes(runs)) == 1
    others = len(list(runs.glob("*--*.json"))) - 1
    assert f"{others} trials in {runs} are of other tasks" in capsys.readouterr().err


def test_the_report_shows_it_beside_the_paper_s(folder):
    page = folder / "report.html"
    words = ["--runs", str(folder / "none"), "--drone", str(folder / "none")]
    words += ["--basin", str(folder / "runs"), "--out", str(page)]
    assert main(["report", *words]) == 0
    text = page.read_text()
    assert "<td>true-depth<td>4°, 4°, 8°<td>overlap ≥ 20%<td>" in text
    assert text.count("data:image/svg") == 1
    assert "Flights" not in text
