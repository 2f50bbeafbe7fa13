"""``table1`` in the report's page: its tables, and the paper's Fig. 2, 4 and 5 with our figures."""

from __future__ import annotations

import html
import math
from collections.abc import Callable, Sequence

import numpy as np

from dfvs_bench.methods.registry import METHODS
from dfvs_bench.report.depth_figure import FIRST_STEP, DepthViews, depth_figure, depth_views
from dfvs_bench.report.figures import controller_figure
from dfvs_bench.report.page import embedded, figure, panel, panels, table
from dfvs_bench.report.paper import PAPER_COLUMNS, paper_scenes
from dfvs_bench.trials.perturbation import PERTURBATIONS, disturbance, perturbed_renderer
from dfvs_bench.trials.results import TrialRecord
from dfvs_bench.trials.tables import perturbed_table, share_text, summarise
from dfvs_bench.trials.task import BenchTask
from dfvs_bench.trials.trial import CONVERGED_M, CONVERGED_RAD
from dfvs_core.geometry.arrays import FloatArray, ImageArray
from dfvs_models.catalog import load_depth_network, load_matcher
from dfvs_sim.render.renderer import Renderer
from dfvs_sim.scene.glb import load_glb

_GREY = 128
_SHOWN_FRAME = 10
_FAR_OFF_M = 0.5
_HEAD = ("method", "converged", "iterations", "path ÷ line", "translation", "÷ depth", "rotation")
_SUMMARY_NOTE = """<p>Means are over the trials that converged; "÷ depth" is the final translation
over the median depth of the goal view. The paper's rows, for scale, are of its own ten scenes:
converged by the same criterion, under 4 cm and 1°, counted from its Table I; its iterations and
paths over the trials that it gives them for; its errors over all ten.</p>"""
_PERTURBED_NOTE = """<p>Trials that converged, without and with a perturbation between goal and
flight; "all of these" adds up those with one.</p>"""
_DEPTH_NOTE = """<p>Depth in m of the view after {step:.0%} of the way from start to goal: the true
one{network}, and α ÷ |flow| to the view at the start, rotation taken out, α by the true median.
{missing}</p>"""
_NETWORK = ", that by the network <code>{}</code>"
_NO_NETWORK = "That by a network is left out: no depth bundle was given."
_SCENES_NOTE = "<p>Final error; path; iterations. NC: not within 4 cm and 1°.</p>"
_IMAGES_NOTE = """<p>Start, goal, and what is left between goal and end for every method: grey is
none. Below each its final error.</p>"""

_Records = dict[tuple[str, str], TrialRecord]


def table1_section(
    tasks: Sequence[BenchTask],
    records: Sequence[TrialRecord],
    depth_bundle: str | None,
    progress: Callable[[str], None],
) -> str:
    """HTML of the sections, with their headings; ``progress`` is told which task is drawn.

    Raises
    ------
    DfvsError
        If a scene, the depth bundle, or the matcher of the records cannot be used.
    """
    matcher = load_matcher(records[0].matcher, threads=1)
    network = None if depth_bundle is None else load_depth_network(depth_bundle, threads=1)
    methods = [name for name in METHODS if any(r.method == name for r in records)]
    by_key = {(r.task, r.method): r for r in records if not r.perturbation}
    tasks = [task for task in tasks if any(r.task == task.name for r in records)]
    views: list[DepthViews] = []
    images, controllers = [], []
    for task in tasks:
        progress(task.name)
        renderer = Renderer(load_glb(task.scene))
        views.append(depth_views(task, renderer, matcher, network))
        images.append(_images(task, renderer, methods, by_key))
        of_task = [by_key[task.name, name] for name in methods if (task.name, name) in by_key]
        if of_task:
            plot = embedded(controller_figure(of_task, "svg"), "svg+xml")
            controllers.append(figure(task.name, plot))
    depth_note = _DEPTH_NOTE.format(
        step=FIRST_STEP,
        network=_NETWORK.format(html.escape(depth_bundle)) if depth_bundle else "",
        missing="" if depth_bundle else _NO_NETWORK,
    )
    parts = [
        "<h2>Summary</h2>",
        _summary_table(records, methods),
        _perturbed(tasks[0], records, methods),
        f"<h2>Every scene</h2>{_SCENES_NOTE}",
        _scene_table(tasks, methods, by_key),
        f"<h2>Depth (Fig. 2)</h2>{depth_note}",
        f"<figure>{embedded(depth_figure(views), 'svg+xml')}</figure>",
        f"<h2>Pictures (Fig. 4)</h2>{_IMAGES_NOTE}",
        *images,
        "<h2>Controllers (Fig. 5)</h2>",
        *controllers,
    ]
    return "\n".join(parts)


def _summary_table(records: Sequence[TrialRecord], methods: Sequence[str]) -> str:
    rows = []
    for name, s in summarise(records, methods)["methods"].items():
        cells = [f"{name}: {METHODS[name].summary}", f"{s['converged']} of {s['scenes']}"]
        if s["converged"]:
            ratio = s["mean_path_ratio"]
            cells += [
                f"{s['mean_iterations']:.0f}",
                "–" if ratio is None else f"{ratio:.2f}",
                f"{1e3 * s['mean_translation_m']:.1f} mm",
                share_text(s["mean_translation_over_depth"]),
                f"{s['mean_rotation_deg']:.2f}°",
            ]
        rows.append(_row([*cells, *["–"] * (len(_HEAD) - len(cells))]))
    rows += [_row(_paper_cells(k), "paper") for k in range(len(PAPER_COLUMNS))]
    head = "<tr>" + "".join(f"<th>{name}" for name in _HEAD)
    return f"<table>{head}{''.join(rows)}</table>{_SUMMARY_NOTE}"


def _row(cells: Sequence[str], kind: str = "") -> str:
    return f"<tr class='{kind}'>" + "".join(f"<td>{html.escape(cell)}" for cell in cells)


def _paper_cells(k: int) -> list[str]:
    """The paper's own figures of one of its methods."""
    good = [
        scene
        for scene in paper_scenes()
        if scene.translation_m[k] < CONVERGED_M
        and math.radians(scene.rotation_deg[k]) < CONVERGED_RAD
    ]
    ways = [(scene.path_m[k], scene.iterations[k], scene.initial[0]) for scene in paper_scenes()]
    done = [(path_m, count, line_m) for path_m, count, line_m in ways if path_m and count]
    return [
        f"the paper's {PAPER_COLUMNS[k]}",
        f"{len(good)} of {len(paper_scenes())}",
        f"{np.mean([count for _, count, _ in done]):.0f}",
        f"{np.mean([path_m / line_m for path_m, _, line_m in done]):.2f}",
        f"{1e3 * np.mean([scene.translation_m[k] for scene in paper_scenes()]):.0f} mm",
        "–",
        f"{np.mean([scene.rotation_deg[k] for scene in paper_scenes()]):.2f}°",
    ]


def _perturbed(task: BenchTask, records: Sequence[TrialRecord], methods: Sequence[str]) -> str:
    """Convergence with perturbations, and what they look like in one task; or nothing."""
    summary = summarise(records, methods)
    if "perturbed" not in summary:
        return ""
    renderer = Renderer(load_glb(task.scene))
    shown = [panel(_view(renderer, task, task.T_world_goal), "goal")]
    for perturbation in (PERTURBATIONS[name] for name in summary["perturbed"]):
        scene = perturbed_renderer(perturbation, task, renderer)
        view = scene.render(task.camera, task.T_world_goal, antialias=True)
        seen = disturbance(perturbation, task)(_SHOWN_FRAME, view).image
        shown.append(panel(seen, perturbation.name))
    images = figure(f"{task.name}: the goal as it is seen in flight", panels(shown))
    return f"<h2>Perturbed</h2>{_PERTURBED_NOTE}{table(*perturbed_table(summary))}{images}"


def _scene_table(tasks: Sequence[BenchTask], methods: Sequence[str], by_key: _Records) -> str:
    head = "<tr><th>method" + "".join(_scene_head(task) for task in tasks)
    rows = [
        f"<tr><td>{name}" + "".join(_cell(by_key.get((task.name, name))) for task in tasks)
        for name in methods
    ]
    return f"<table class='scenes'>{head}{''.join(rows)}</table>"


def _scene_head(task: BenchTask) -> str:
    distance_m, angle_rad = task.initial_error
    return f"<th>{html.escape(task.name)}<br>{distance_m:.2f} m {math.degrees(angle_rad):.0f}°"


def _cell(record: TrialRecord | None) -> str:
    if record is None:
        return "<td>–"
    trial = record.trial
    if not trial.converged:
        return f"<td class='nc' title='{html.escape(trial.end)}'>{_error_text(record)}<br>NC"
    return f"<td>{_error_text(record)}<br>{trial.path_m:.2f} m; {trial.iterations}"


def _error_text(record: TrialRecord) -> str:
    """Final error of a trial for people; what is far off, with fewer digits."""
    final, degrees = record.trial.final, math.degrees(record.trial.final.angle_rad)
    if final.distance_m < _FAR_OFF_M:
        return f"{1e3 * final.distance_m:.0f} mm {degrees:.2f}°"
    return f"{final.distance_m:.2f} m {degrees:.0f}°"


def _images(task: BenchTask, renderer: Renderer, methods: Sequence[str], by_key: _Records) -> str:
    """Start, goal and the difference that each method leaves."""
    goal = _view(renderer, task, task.T_world_goal)
    parts = [panel(_view(renderer, task, task.T_world_start), "start"), panel(goal, "goal")]
    for name in methods:
        record = by_key.get((task.name, name))
        if record is not None:
            T_end = np.array(record.trial.T_world_end).reshape(4, 4)
            left = _difference(_view(renderer, task, T_end), goal)
            is_good = record.trial.converged
            note = _error_text(record) if is_good else f"NC: {_error_text(record)}"
            parts.append(panel(left, name, note, "" if is_good else "nc"))
    return figure(task.name, panels(parts))


def _view(renderer: Renderer, task: BenchTask, T_world_camera: FloatArray) -> ImageArray:
    return renderer.render(task.camera, T_world_camera, antialias=True).image


def _difference(a: ImageArray, b: ImageArray) -> ImageArray:
    """Grey where two images agree."""
    half = (a.astype(np.int16) - b.astype(np.int16)) // 2 + _GREY
    return half.astype(np.uint8)
