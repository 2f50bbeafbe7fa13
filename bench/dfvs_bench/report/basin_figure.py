"""The paper's Fig. 6 with our figures: convergence ratio against translation."""

from collections.abc import Sequence
from typing import Any

from matplotlib import style
from matplotlib.figure import Figure
from matplotlib.ticker import PercentFormatter

from dfvs_bench.basin.drawing import LEAST_OVERLAP
from dfvs_bench.basin.outcomes import Outcome
from dfvs_bench.basin.ratios import Curve, Rotation, curves, share
from dfvs_bench.report.figures import COLOURS, COLUMN_IN, STYLE, file_of
from dfvs_bench.report.paper import PAPER_BASIN

_MARKERS = "osD^vX"
_PANEL_IN, _NAMES_IN = 1.25, 0.5


def basin_figure(outcomes: Sequence[Outcome], file_format: str) -> bytes:
    """File (``png``, ``svg`` or ``pdf``) with two panels a method: all tasks, those with overlap.

    Bars are 95 % intervals; a dotted line of the same colour is what the paper's text says of the
    rotation set.
    """
    found = curves(outcomes)
    methods = list(dict.fromkeys(curve.method for curve in found))
    rotations = sorted({curve.rotation_deg for curve in found})
    with style.context(STYLE):
        size = COLUMN_IN, _PANEL_IN * len(methods) + _NAMES_IN
        figure = Figure(figsize=size, layout="constrained")
        panels = figure.subplots(len(methods), 2, squeeze=False, sharex=True, sharey=True)
        for j, method in enumerate(methods):
            for i, overlapping in enumerate((False, True)):
                drawn = [c for c in found if (c.method, c.overlapping) == (method, overlapping)]
                _panel(panels[j][i], drawn, rotations)
            panels[j][0].set_title(method, fontweight="bold")
        panels[0][1].set_title(f"start sees ≥ {LEAST_OVERLAP:.0%} of the goal")
        panels[0][0].set_title("all tasks", loc="right")
        for axes in panels[-1]:
            axes.set_xlabel("initial translation (m per axis)")
        figure.supylabel("convergence ratio", fontsize=7)
        figure.legend(
            *panels[0][0].get_legend_handles_labels(),
            title="rotation about x, y, z (dotted: the paper's text)",
            loc="outside lower center",
            ncols=len(rotations),
        )
        return file_of(figure, file_format)


def _panel(axes: Any, drawn: Sequence[Curve], rotations: Sequence[Rotation]) -> None:
    for curve in drawn:
        k = rotations.index(curve.rotation_deg)
        colour = COLOURS[k % len(COLOURS)]
        shares = {d: share(group) for d, group in curve.points.items()}
        bars = [
            [s.ratio - s.interval[0] for s in shares.values()],
            [s.interval[1] - s.ratio for s in shares.values()],
        ]
        # Side by side, so that the bars of the sets do not hide each other.
        aside_m = 0.04 * (k - (len(rotations) - 1) / 2)
        axes.errorbar(
            [d + aside_m for d in shares],
            [s.ratio for s in shares.values()],
            yerr=[[max(0.0, v) for v in bar] for bar in bars],
            color=colour,
            marker=_MARKERS[k % len(_MARKERS)],
            markersize=2.5,
            elinewidth=0.6,
            capsize=1.5,
            label=", ".join(f"{a:g}°" for a in curve.rotation_deg),
        )
        paper = PAPER_BASIN.get(curve.rotation_deg)
        if paper is not None:
            axes.axhline(paper.ratio, color=colour, linestyle=":", linewidth=0.9)
    axes.set_ylim(-0.03, 1.03)
    axes.yaxis.set_major_formatter(PercentFormatter(1.0))
