"""What the benchmark's report does with trials of methods that it does not know."""

import pytest

from dfvs_bench.cli import main
from dfvs_bench.report.figures import method_styles
from dfvs_bench.trials.results import TrialRecord, write_record
from dfvs_bench.trials.scenes import default_tasks
from dfvs_bench.trials.trial import Step, Trial

KITCHEN = next(task for task in default_tasks() if task.name == "kitchen")


def record(method):
    start, goal = (tuple(pose.ravel().tolist()) for pose in KITCHEN.poses)
    step = Step((0.0, 0.0, 0.0), 1.0, 0.1, 1.0, (0.0,) * 6)
    return TrialRecord(
        task=KITCHEN.name,
        difficulty=KITCHEN.difficulty,
        method=method,
        matcher="classical",
        most_iterations=1,
        start=start,
        goal=goal,
        size=KITCHEN.camera.size,
        version="",
        revision="",
        inputs="",
        seed=None,
        seconds=1.0,
        trial=Trial((step, step), "iterations", start),
    )


def test_trials_of_an_unknown_method_are_left_out_and_named(tmp_path, capsys):
    for method in ("my-servoing", "my-servoing-2"):
        write_record(tmp_path, record(method))
    words = ["--runs", str(tmp_path), "--out", str(tmp_path / "report.html")]
    assert main(["report", *words]) == 2
    line = capsys.readouterr().err.splitlines()[0]
    assert "2 trials" in line
    assert "my-servoing, my-servoing-2" in line
    assert "left out" in line


@pytest.mark.parametrize("names", [("pnp", "my-a", "my-b"), ("my-b", "my-a")])
def test_methods_have_styles_of_their_own(names):
    styles = method_styles(names)
    assert len({tuple(sorted(styles[name].items())) for name in names}) == len(names)


def test_a_known_method_has_the_same_style_beside_any_other():
    assert method_styles(["pnp"])["pnp"] == method_styles(["my-a", "pnp"])["pnp"]
