"""Methods and tasks in the benchmark's report and plots."""

import dataclasses

import numpy as np
import pytest
from matplotlib import style
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.text import Text

from dfvs_bench.cli import main
from dfvs_bench.report.figures import STYLE, draw_controller, method_styles
from dfvs_bench.report.report import Contents, report_page
from dfvs_bench.trials.results import TrialRecord, write_record
from dfvs_bench.trials.scenes import default_tasks
from dfvs_bench.trials.settings import setting_tasks
from dfvs_bench.trials.trial import Step, Trial

KEPT, OTHER = "its initial distances and angles are kept", "and so are the tasks"
KITCHEN = next(task for task in default_tasks() if task.name == "kitchen")


def record(method):
    start, goal = (tuple(pose.ravel().tolist()) for pose in KITCHEN.poses)
    twist = np.array([0.3, 0.3, 0.3, 0.003, 0.003, 0.003])  # its ticks take much room
    steps = tuple(
        Step((0.0, 0.0, 0.0), error, error, error, tuple((error * twist).tolist()))
        for error in (1.0, 0.4, 0.16)
    )
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
        trial=Trial(steps, "iterations", start),
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


def test_the_report_does_not_say_that_photometric_servoing_was_run_where_it_was_not():
    page = report_page(Contents([KITCHEN], [record("motion-depth")]), lambda _: None)
    assert "run here" not in page


def test_the_report_names_the_networks_of_the_trials():
    by_network = dataclasses.replace(record("motion-depth"), network="my-depth")
    page = report_page(Contents([KITCHEN], [by_network]), lambda _: None)
    assert "Depth or pose networks of the trials: <code>my-depth</code>" in page


@pytest.mark.parametrize("names", [("pnp", "my-a", "my-b"), ("my-b", "my-a")])
def test_methods_have_styles_of_their_own(names):
    styles = method_styles(names)
    assert len({tuple(sorted(styles[name].items())) for name in names}) == len(names)


def test_a_known_method_has_the_same_style_beside_any_other():
    assert method_styles(["pnp"])["pnp"] == method_styles(["my-a", "pnp"])["pnp"]


def test_the_titles_of_the_controller_s_plot_are_whole():
    with style.context(STYLE):
        figure = draw_controller([record("pnp")])
        FigureCanvasAgg(figure).draw()
    titles = [text for text in figure.findobj(Text) if text.get_text().startswith("(")]
    assert [title.get_text()[:3] for title in titles] == ["(a)", "(b)", "(c)", "(d)", "(e)"]
    assert max(title.get_window_extent().x1 for title in titles) <= figure.bbox.x1


def test_the_velocities_of_the_controller_s_plot_are_motions_over_the_frame_period():
    labels = [axes.get_ylabel() for axes in draw_controller([record("published")]).axes]
    assert labels[1:3] == ["m ÷ 0.1 s", "rad ÷ 0.1 s"]


@pytest.mark.parametrize(
    ("setting", "said"),
    [("default", [KEPT]), ("near", [OTHER]), ("none", [])],
)
def test_only_the_paper_s_initial_errors_are_said_to_be_kept(tmp_path, setting, said):
    if setting == "default":
        tasks = default_tasks()
    else:
        tasks = [] if setting == "none" else setting_tasks(setting, 0.25, tmp_path)
    page = report_page(Contents(tasks), lambda _: None)
    assert [text for text in (KEPT, OTHER) if text in page] == said
