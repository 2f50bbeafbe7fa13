"""The basin in the report's page: Fig. 6 with our figures, and what the paper says."""

from __future__ import annotations

from collections.abc import Iterator, Sequence

from dfvs_bench.basin.drawing import LEAST_OVERLAP
from dfvs_bench.basin.outcomes import Outcome
from dfvs_bench.basin.ratios import Curve, curves
from dfvs_bench.report.basin_figure import basin_figure
from dfvs_bench.report.page import embedded, table
from dfvs_bench.report.paper import PAPER_BASIN

_HEAD = ("method", "rotation x, y, z", "tasks", "converged", "ratio", "95 %", "out to", "the paper")
_METHODS_A_FIGURE = 6
_TEXT = """<p>How often a trial ends within 4 cm and 1° of the goal, by how far from it it starts;
bars and the column "95 %" are Wilson's intervals. The paper's ratios are what its text says of
flow-depth (dotted lines). It displaces all three axes alike, in scans and with no word about walls
or overlap; here one axis has the whole translation and the others any share of it, since no room
is high enough for more, the straight way is free, and the second kind of tasks starts where at
least {overlap:.0%} of the goal's pixels are seen. {environments} environments, seed {seeds}.</p>"""


def basin_section(outcomes: Sequence[Outcome]) -> str:
    """HTML of the section, with its heading."""
    text = _TEXT.format(
        overlap=LEAST_OVERLAP,
        seeds=", ".join(str(seed) for seed in sorted({o.seed for o in outcomes})),
        environments=len({o.drawn.environment for o in outcomes}),
    )
    rows = [_row(curve) for curve in curves(outcomes) if curve.outcomes]
    return f"<h2>Basin (Fig. 6)</h2>{text}{table(_HEAD, rows)}{''.join(_figures(outcomes))}"


def _figures(outcomes: Sequence[Outcome]) -> Iterator[str]:
    """Figures that fit on a page each."""
    methods = list(dict.fromkeys(o.record.method for o in outcomes))
    for k in range(0, len(methods), _METHODS_A_FIGURE):
        part = methods[k : k + _METHODS_A_FIGURE]
        shown = [o for o in outcomes if o.record.method in part]
        yield f"<figure>{embedded(basin_figure(shown, 'svg'), 'svg+xml')}</figure>"


def _row(curve: Curve) -> tuple[str, ...]:
    share = curve.share
    low, high = share.interval
    paper = PAPER_BASIN.get(curve.rotation_deg)
    return (
        curve.method,
        ", ".join(f"{angle:g}°" for angle in curve.rotation_deg),
        f"overlap ≥ {LEAST_OVERLAP:.0%}" if curve.overlapping else "all",
        f"{share.successes} of {share.trials}",
        f"{share.ratio:.0%}",
        f"{low:.0%} to {high:.0%}",
        f"{max(curve.points):g} m per axis",
        paper.words if paper is not None else "only in its plot",
    )
