"""``table1`` in the report's page: its tables, and the paper's Fig. 2, 4 and 5 with our figures."""

import math
from collections.abc import Callable, Sequence
from typing import Any

import numpy as np

from dfvs_bench.methods.registry import METHODS
from dfvs_bench.report.depth_figure import FIRST_STEP, DepthViews, depth_figure, depth_views
from dfvs_bench.report.figures import controller_figure
from dfvs_bench.report.page import Panel, render
from dfvs_bench.report.paper import PAPER_COLUMNS, paper_scenes
from dfvs_bench.trials.perturbation import PERTURBATIONS, disturbance, perturbed_renderer
from dfvs_bench.trials.results import TrialRecord
from dfvs_bench.trials.tables import perturbed_table, summarise
from dfvs_bench.trials.task import BenchTask
from dfvs_bench.trials.trial import CONVERGED_M, CONVERGED_RAD
from dfvs_core.geometry.arrays import FloatArray, ImageArray
from dfvs_models.catalog import load_depth_network, load_matcher
from dfvs_sim.render.renderer import Renderer
from dfvs_sim.scene.glb import load_glb

_GREY = 128
_SHOWN_FRAME = 10
_FAR_OFF_M = 0.5
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
        images.append((task.name, _panels(task, renderer, methods, by_key)))
        of_task = [by_key[task.name, name] for name in methods if (task.name, name) in by_key]
        if of_task:
            controllers.append((task.name, controller_figure(of_task, "svg")))
    summary = summarise(records, methods)
    return render(
        "table1.html.j2",
        summary=summary,
        texts=METHODS,
        paper=[_paper_cells(k) for k in range(len(PAPER_COLUMNS))],
        perturbed=_perturbed(tasks[0], summary) if "perturbed" in summary else None,
        tasks=tasks,
        methods=methods,
        by_key=by_key,
        error_text=_error_text,
        step=FIRST_STEP,
        network=depth_bundle,
        depths=depth_figure(views),
        images=images,
        controllers=controllers,
    )


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


def _perturbed(task: BenchTask, summary: dict[str, Any]) -> dict[str, Any]:
    """Convergence with perturbations, and what they look like in one task."""
    renderer = Renderer(load_glb(task.scene))
    shown = [Panel(_view(renderer, task, task.T_world_goal), "goal")]
    for perturbation in (PERTURBATIONS[name] for name in summary["perturbed"]):
        scene = perturbed_renderer(perturbation, task, renderer)
        view = scene.render(task.camera, task.T_world_goal, antialias=True)
        seen = disturbance(perturbation, task)(_SHOWN_FRAME, view).image
        shown.append(Panel(seen, perturbation.name))
    return {"table": perturbed_table(summary), "panels": shown}


def _error_text(record: TrialRecord) -> str:
    """Final error of a trial for people; what is far off, with fewer digits."""
    final, degrees = record.trial.final, math.degrees(record.trial.final.angle_rad)
    if final.distance_m < _FAR_OFF_M:
        return f"{1e3 * final.distance_m:.0f} mm {degrees:.2f}°"
    return f"{final.distance_m:.2f} m {degrees:.0f}°"


def _panels(
    task: BenchTask, renderer: Renderer, methods: Sequence[str], by_key: _Records
) -> list[Panel]:
    """Start, goal and the difference that each method leaves."""
    goal = _view(renderer, task, task.T_world_goal)
    parts = [Panel(_view(renderer, task, task.T_world_start), "start"), Panel(goal, "goal")]
    for name in methods:
        record = by_key.get((task.name, name))
        if record is not None:
            T_end = np.array(record.trial.T_world_end).reshape(4, 4)
            left = _difference(_view(renderer, task, T_end), goal)
            note, kind = _error_text(record), ""
            if not record.trial.converged:
                note, kind = f"NC: {note}", "nc"
            parts.append(Panel(left, name, note, kind))
    return parts


def _view(renderer: Renderer, task: BenchTask, T_world_camera: FloatArray) -> ImageArray:
    return renderer.render(task.camera, T_world_camera, antialias=True).image


def _difference(a: ImageArray, b: ImageArray) -> ImageArray:
    """Grey where two images agree."""
    half = (a.astype(np.int16) - b.astype(np.int16)) // 2 + _GREY
    return half.astype(np.uint8)
