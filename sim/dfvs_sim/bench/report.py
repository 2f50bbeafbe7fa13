"""One self-contained HTML page of a campaign: tables, pictures, plots, and the paper beside it."""

from __future__ import annotations

import html
import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from importlib.metadata import version

import cv2
import numpy as np

from dfvs_core.arrays import ImageArray
from dfvs_core.wire.picture import encode_jpeg
from dfvs_sim.bench.basin.outcomes import Outcome
from dfvs_sim.bench.basin.section import basin_section
from dfvs_sim.bench.drone.records import FlightRecord
from dfvs_sim.bench.drone.section import drone_section
from dfvs_sim.bench.figures import controller_figure
from dfvs_sim.bench.methods import METHODS
from dfvs_sim.bench.page import embedded
from dfvs_sim.bench.paper import PAPER_COLUMNS, PAPER_SCENES
from dfvs_sim.bench.results import TrialRecord
from dfvs_sim.bench.scenes import SCENES
from dfvs_sim.bench.task import BenchTask
from dfvs_sim.bench.trial import CONVERGED_M, CONVERGED_RAD
from dfvs_sim.render.renderer import Renderer
from dfvs_sim.scene.glb import load_glb

_JPEG_QUALITY = 88
_THUMBNAIL_PX = 124
_GREY = 128
_STYLE = """
body { font: 15px/1.5 system-ui, sans-serif; color: #222;
       margin: 2rem auto; max-width: 100rem; padding: 0 1rem; }
table { border-collapse: collapse; margin: 1rem 0; font-variant-numeric: tabular-nums; }
th, td { padding: .2rem .6rem; text-align: right; white-space: nowrap;
         border-bottom: 1px solid #ddd; }
th { white-space: normal; vertical-align: bottom; }
tr.paper td { color: #666; }
th:first-child, td:first-child { text-align: left; }
td.nc { color: #b3362f; } img { display: block; } figure { margin: 1rem 0; }
.grid td { padding: 2px; border: 0; text-align: center; font-size: 12px; white-space: normal; }
.scenes { font-size: 13px; }
"""
_SUMMARY_COLUMNS = 6
_SUMMARY_NOTE = """<p>Means are over the trials that converged. The paper's rows, for scale, are of
its own ten scenes: converged by the same criterion, under 4 cm and 1°, counted from its Table I;
its iterations and paths over the trials that it gives them for; its errors over all ten.</p>"""
_TEN_SCENES = """our scenes are generated rooms and not scans, seen by our renderer and not by
Habitat; its initial distances and angles are kept, not its poses"""
_OTHER_SCENES = """the scenes are other ones, and so are the tasks; our renderer shows them, not
Habitat"""
_DIFFERENCES = """What differs from the paper: {scenes}. Pictures are {size}, the paper's 512 × 384.
Flow comes from the matcher <code>{matcher}</code>, the paper's from FlowNet2. The paper's own runs,
with its networks, were not repeated: its columns are quoted from its Table I. Its method [3],
photometric servoing, is our <code>photometric</code>, run here. Ours end by their own stop rule and
never by photometric error."""


@dataclass(frozen=True, slots=True)
class Contents:
    """What a report is about; empty is what was not measured.

    Parameters
    ----------
    tasks : sequence of BenchTask
        Those that the records are of.
    records : sequence of TrialRecord
        Of ``table1``, in any order, from as many methods and tasks as there are.
    outcomes : sequence of Outcome
        Of ``basin``.
    flights : sequence of FlightRecord
        Of ``drone``.
    """

    tasks: Sequence[BenchTask] = ()
    records: Sequence[TrialRecord] = ()
    outcomes: Sequence[Outcome] = ()
    flights: Sequence[FlightRecord] = ()

    @property
    def trials(self) -> list[TrialRecord]:
        """All trials with a free camera."""
        return [*self.records, *(outcome.record for outcome in self.outcomes)]


def report_page(contents: Contents, progress: Callable[[str], None]) -> str:
    """Write the page.

    Parameters
    ----------
    contents : Contents
    progress : callable
        Told which task is being drawn.
    """
    parts = [
        "<!doctype html><html lang='en'><meta charset='utf-8'><title>DFVS benchmark</title>",
        f"<style>{_STYLE}</style><h1>DFVS benchmark</h1>",
        f"<p>{_provenance(contents)}</p><p>{_differences(contents)}</p>",
    ]
    if contents.records:
        parts += _table_sections(contents.tasks, contents.records, progress)
    if contents.outcomes:
        parts.append(basin_section(contents.outcomes))
    if contents.flights:
        parts.append(drone_section(contents.flights))
    parts += ["<h2>The paper's Table I</h2>", _paper_table(), "</html>"]
    return "\n".join(parts)


def _table_sections(
    tasks: Sequence[BenchTask], records: Sequence[TrialRecord], progress: Callable[[str], None]
) -> list[str]:
    """Tables, pictures and controllers of ``table1``."""
    known = [name for name in METHODS if any(r.method == name for r in records)]
    by_key = {(r.task, r.method): r for r in records}
    tasks = [task for task in tasks if any(r.task == task.name for r in records)]
    parts = [
        "<h2>Summary</h2>",
        _summary_table(records, known, [task.name for task in tasks]),
        "<h2>Every scene</h2><p>Final error; path; iterations. NC: not within 4 cm and 1°.</p>",
        _scene_table(tasks, known, by_key),
        "<h2>Pictures</h2><p>Start, goal, and what is left between goal and end: grey is none."
        "</p><table class='grid'>",
        _picture_head(known),
    ]
    for task in tasks:
        progress(task.name)
        parts.append(_picture_row(task, known, by_key))
    parts.append("</table><h2>Controllers</h2>")
    for task in tasks:
        of_task = [by_key[task.name, name] for name in known if (task.name, name) in by_key]
        parts.append(f"<figure><figcaption>{html.escape(task.name)}</figcaption>")
        parts.append(embedded(controller_figure(of_task), "png", 900) + "</figure>")
    return parts


def _provenance(contents: Contents) -> str:
    trials, flights = contents.trials, contents.flights
    revisions = sorted({*(r.revision for r in trials), *(f.revision for f in flights)})
    hours = sum(r.seconds for r in trials) / 3600.0
    return (
        f"{len(trials)} trials, {hours:.1f} hours one after the other, and {len(flights)} "
        f"flights; dfvs {version('dfvs')}, revision {html.escape(', '.join(revisions))}."
    )


def _differences(contents: Contents) -> str:
    trials, flights = contents.trials, contents.flights
    sizes = {*(tuple(r.size) for r in trials), *(tuple(f.size) for f in flights)}
    matchers = sorted({*(r.matcher for r in trials), *(f.matcher for f in flights)})
    names = {spec.name for spec in SCENES}
    are_ours = all(task.name in names for task in contents.tasks)
    return _DIFFERENCES.format(
        scenes=_TEN_SCENES if are_ours else _OTHER_SCENES,
        size=", ".join(f"{width} × {height}" for width, height in sorted(sizes)),
        matcher=html.escape(", ".join(matchers)),
    )


def _summary_table(
    records: Sequence[TrialRecord], methods: Sequence[str], tasks: Sequence[str]
) -> str:
    head = "<tr><th>method<th>converged<th>iterations<th>path ÷ line<th>translation<th>rotation"
    rows = []
    for name in methods:
        group = [r.trial for r in records if r.method == name and r.task in tasks]
        good = [trial for trial in group if trial.converged]
        ratios = [t.path_ratio for t in good if t.path_ratio is not None]
        cells = [f"{name}: {METHODS[name].summary}", f"{len(good)} of {len(group)}"]
        if good:
            cells += [
                f"{np.mean([t.iterations for t in good]):.0f}",
                f"{np.mean(ratios):.2f}" if ratios else "–",
                f"{1e3 * np.mean([t.final.distance_m for t in good]):.1f} mm",
                f"{np.degrees(np.mean([t.final.angle_rad for t in good])):.2f}°",
            ]
        cells += ["–"] * (_SUMMARY_COLUMNS - len(cells))
        rows.append("<tr>" + "".join(f"<td>{html.escape(c)}" for c in cells))
    rows += [_paper_row(name) for name in PAPER_COLUMNS]
    return f"<table>{head}{''.join(rows)}</table>{_SUMMARY_NOTE}"


def _paper_row(name: str) -> str:
    """The paper's own figures of one of its methods, in grey."""
    k = PAPER_COLUMNS.index(name)
    good = [
        scene
        for scene in PAPER_SCENES
        if scene.translation_m[k] < CONVERGED_M
        and math.radians(scene.rotation_deg[k]) < CONVERGED_RAD
    ]
    ways = [(scene.path_m[k], scene.iterations[k], scene.initial[0]) for scene in PAPER_SCENES]
    done = [(path_m, count, line_m) for path_m, count, line_m in ways if path_m and count]
    cells = [
        f"the paper's {name}",
        f"{len(good)} of {len(PAPER_SCENES)}",
        f"{np.mean([count for _, count, _ in done]):.0f}",
        f"{np.mean([path_m / line_m for path_m, _, line_m in done]):.2f}",
        f"{1e3 * np.mean([scene.translation_m[k] for scene in PAPER_SCENES]):.0f} mm",
        f"{np.mean([scene.rotation_deg[k] for scene in PAPER_SCENES]):.2f}°",
    ]
    return "<tr class='paper'>" + "".join(f"<td>{html.escape(cell)}" for cell in cells)


def _scene_table(
    tasks: Sequence[BenchTask],
    methods: Sequence[str],
    by_key: dict[tuple[str, str], TrialRecord],
) -> str:
    head = "<tr><th>scene<th>start" + "".join(f"<th>{name}" for name in methods)
    rows = []
    for task in tasks:
        distance_m, angle_rad = task.initial_error
        row = f"<tr><td>{html.escape(task.name)}<td>{distance_m:.2f} m {_degrees(angle_rad)}"
        rows.append(row + "".join(_cell(by_key.get((task.name, name))) for name in methods))
    return f"<table class='scenes'>{head}{''.join(rows)}</table>"


def _cell(record: TrialRecord | None) -> str:
    if record is None:
        return "<td>–"
    trial = record.trial
    errors = f"{1e3 * trial.final.distance_m:.0f} mm {_degrees(trial.final.angle_rad)}"
    if not trial.converged:
        return f"<td class='nc' title='{html.escape(trial.end)}'>{errors}<br>NC"
    return f"<td>{errors}<br>{trial.path_m:.2f} m; {trial.iterations}"


def _degrees(angle_rad: float) -> str:
    return f"{math.degrees(angle_rad):.2f}°"


def _picture_head(methods: Sequence[str]) -> str:
    names = ("", "start", "goal", *methods)
    return "<tr>" + "".join(f"<td>{name}" for name in names)


def _picture_row(
    task: BenchTask, methods: Sequence[str], by_key: dict[tuple[str, str], TrialRecord]
) -> str:
    renderer = Renderer(load_glb(task.scene))

    def view(T_world_camera: object) -> ImageArray:
        T = np.asarray(T_world_camera, dtype=np.float64).reshape(4, 4)
        return renderer.render(task.camera, T, antialias=True).image

    goal = view(task.T_world_goal)
    cells = [html.escape(task.name), _picture(view(task.T_world_start)), _picture(goal)]
    for name in methods:
        record = by_key.get((task.name, name))
        if record is None:
            cells.append("–")
        else:
            cells.append(_picture(_difference(view(record.trial.T_world_end), goal)))
    return "<tr>" + "".join(f"<td>{cell}" for cell in cells)


def _difference(a: ImageArray, b: ImageArray) -> ImageArray:
    """Grey where two pictures agree."""
    half = (a.astype(np.int16) - b.astype(np.int16)) // 2 + _GREY
    return half.astype(np.uint8)


def _picture(image: ImageArray) -> str:
    height = round(_THUMBNAIL_PX * image.shape[0] / image.shape[1])
    small = cv2.resize(image, (_THUMBNAIL_PX, height), interpolation=cv2.INTER_AREA)
    thumbnail = np.asarray(small, dtype=np.uint8)
    return embedded(encode_jpeg(thumbnail, _JPEG_QUALITY), "jpeg", _THUMBNAIL_PX)


def _paper_table() -> str:
    head = "<tr><th>start" + "".join(f"<th>{name}" for name in PAPER_COLUMNS)
    rows = []
    for scene in PAPER_SCENES:
        row = f"<tr><td>{scene.initial[0]:.2f} m {scene.initial[1]:.2f}°"
        for k in range(len(PAPER_COLUMNS)):
            path, iterations = scene.path_m[k], scene.iterations[k]
            way = "NC" if iterations is None or path is None else f"{path:.2f} m; {iterations}"
            errors = f"{1e3 * scene.translation_m[k]:.0f} mm {scene.rotation_deg[k]:.2f}°"
            row += f"<td>{errors}<br>{way}"
        rows.append(row)
    return f"<table>{head}{''.join(rows)}</table>"
