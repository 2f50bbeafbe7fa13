"""One self-contained HTML page of a run: tables, images, plots, and the paper's figures."""

from __future__ import annotations

import html
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from importlib.metadata import version

from dfvs_bench.basin.outcomes import Outcome
from dfvs_bench.drone.records import FlightRecord
from dfvs_bench.report.basin_section import basin_section
from dfvs_bench.report.drone_section import drone_section
from dfvs_bench.report.page import style
from dfvs_bench.report.paper import PAPER_COLUMNS, paper_scenes
from dfvs_bench.report.table1_section import table1_section
from dfvs_bench.trials.results import TrialRecord
from dfvs_bench.trials.scenes import SCENES
from dfvs_bench.trials.task import BenchTask

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
    depth_bundle : str or None
        Depth network to be shown beside the true depth.
    """

    tasks: Sequence[BenchTask] = ()
    records: Sequence[TrialRecord] = ()
    outcomes: Sequence[Outcome] = ()
    flights: Sequence[FlightRecord] = ()
    depth_bundle: str | None = None

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
        "<!doctype html><html lang='en'><meta charset='utf-8'>"
        "<meta name='viewport' content='width=device-width, initial-scale=1'>"
        "<title>DFVS benchmark</title>",
        f"<style>{style()}</style><h1>DFVS benchmark</h1>",
        f"<p>{_provenance(contents)}</p><p>{_differences(contents)}</p>",
    ]
    if contents.records:
        drawn = contents.tasks, contents.records, contents.depth_bundle
        parts.append(table1_section(*drawn, progress))
    if contents.outcomes:
        parts.append(basin_section(contents.outcomes))
    if contents.flights:
        parts.append(drone_section(contents.flights))
    parts += ["<h2>The paper's Table I</h2>", _paper_table(), "</html>"]
    return "\n".join(parts)


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


def _paper_table() -> str:
    head = "<tr><th>start" + "".join(f"<th>{name}" for name in PAPER_COLUMNS)
    rows = []
    for scene in paper_scenes():
        row = f"<tr><td>{scene.initial[0]:.2f} m {scene.initial[1]:.2f}°"
        for k in range(len(PAPER_COLUMNS)):
            path, iterations = scene.path_m[k], scene.iterations[k]
            way = "NC" if iterations is None or path is None else f"{path:.2f} m; {iterations}"
            errors = f"{1e3 * scene.translation_m[k]:.0f} mm {scene.rotation_deg[k]:.2f}°"
            row += f"<td>{errors}<br>{way}"
        rows.append(row)
    return f"<table>{head}{''.join(rows)}</table>"
