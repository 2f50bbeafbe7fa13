"""The basin in the report's page: Fig. 6 with our figures, and what the paper says."""

from collections.abc import Sequence

from dfvs_bench.basin.drawing import LEAST_OVERLAP
from dfvs_bench.basin.outcomes import Outcome
from dfvs_bench.basin.ratios import curves
from dfvs_bench.report.basin_figure import basin_figure
from dfvs_bench.report.page import render
from dfvs_bench.report.paper import PAPER_BASIN

_METHODS_A_FIGURE = 6
"""So that a figure fits on a page."""


def basin_section(outcomes: Sequence[Outcome]) -> str:
    """HTML of the section, with its heading."""
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
