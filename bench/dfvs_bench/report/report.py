"""One self-contained HTML page of a run: tables, images, plots, and the paper's figures."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from importlib.metadata import version

from dfvs_bench.basin.drawing import LEAST_OVERLAP
from dfvs_bench.basin.outcomes import Outcome
from dfvs_bench.basin.ratios import curves
from dfvs_bench.drone.records import FlightRecord
from dfvs_bench.drone.tables import summarise, summary_line
from dfvs_bench.report.basin_figure import basin_figure
from dfvs_bench.report.page import render
from dfvs_bench.report.paper import PAPER_BASIN, PAPER_COLUMNS, paper_scenes
from dfvs_bench.report.table1_section import table1_section
from dfvs_bench.trials.results import TrialRecord
from dfvs_bench.trials.scenes import default_tasks
from dfvs_bench.trials.task import BenchTask, same_poses

_METHODS_A_FIGURE = 6
"""So that a figure fits on a page."""


@dataclass(frozen=True, slots=True)
class Contents:
    """What a report is about; empty is what was not measured."""

    tasks: Sequence[BenchTask] = ()
    """Those that the records are of."""
    records: Sequence[TrialRecord] = ()
    """Of ``table1``, in any order, from as many methods and tasks as there are."""
    outcomes: Sequence[Outcome] = ()
    flights: Sequence[FlightRecord] = ()
    depth_bundle: str | None = None
    """Depth network to be shown beside the true depth."""


def report_page(contents: Contents, progress: Callable[[str], None]) -> str:
    """HTML of the page; ``progress`` is told which task is being drawn."""
    trials = [*contents.records, *(outcome.record for outcome in contents.outcomes)]
    flights = contents.flights
    sections = []
    if contents.records:
        drawn = contents.tasks, contents.records, contents.depth_bundle
        sections.append(table1_section(*drawn, progress))
    if contents.outcomes:
        sections.append(basin_section(contents.outcomes))
    if flights:
        sections.append(drone_section(flights))
    return render(
        "report.html.j2",
        trials=trials,
        flights=flights,
        version=version("dfvs"),
        revisions=sorted({*(r.revision for r in trials), *(f.revision for f in flights)}),
        tasks=contents.tasks,
        are_ours=_are_default(contents.tasks),
        sizes=sorted({*(tuple(r.size) for r in trials), *(tuple(f.size) for f in flights)}),
        matchers=sorted({*(r.matcher for r in trials), *(f.matcher for f in flights)}),
        networks=sorted({r.network for r in trials} - {""}),
        sections=sections,
        columns=PAPER_COLUMNS,
        scenes=paper_scenes(),
    )


def basin_section(outcomes: Sequence[Outcome]) -> str:
    """HTML of the basin, with its heading: Fig. 6 with our figures, and what the paper says."""
    methods = list(dict.fromkeys(o.record.method for o in outcomes))
    parts = [methods[k : k + _METHODS_A_FIGURE] for k in range(0, len(methods), _METHODS_A_FIGURE)]
    return render(
        "basin.html.j2",
        overlap=LEAST_OVERLAP,
        seeds=sorted({o.seed for o in outcomes}),
        environments=len({o.drawn.environment for o in outcomes}),
        curves=[curve for curve in curves(outcomes) if curve.outcomes],
        paper=PAPER_BASIN,
        plots=[basin_figure([o for o in outcomes if o.record.method in p], "svg") for p in parts],
    )


def drone_section(records: Sequence[FlightRecord]) -> str:
    """HTML of the flights, with their heading."""
    summary = summary_line(summarise(records))
    return render("drone.html.j2", records=records, summary=summary)


def _are_default(tasks: Sequence[BenchTask]) -> bool:
    """Whether all are tasks that come with the package, poses included."""
    poses = {task.name: task.poses for task in default_tasks()}
    return all(t.name in poses and same_poses(t.poses, poses[t.name]) for t in tasks)
