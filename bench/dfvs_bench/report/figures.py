"""Plots of the benchmark in one style, for one column of a printed page; the paper's Fig. 5."""

import io
from collections.abc import Iterable, Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np
from matplotlib import style
from matplotlib.figure import Figure
from matplotlib.ticker import MaxNLocator, NullLocator

from dfvs_bench.methods.method import FRAME_PERIOD_S
from dfvs_bench.methods.registry import METHODS
from dfvs_bench.trials.results import TrialRecord
from dfvs_core.errors import ConfigError
from dfvs_core.geometry.arrays import FloatArray

COLUMN_IN = 3.5
"""Width of a column of a page with two columns."""

STYLE = Path(__file__).with_suffix(".mplstyle")
"""Of all plots of the benchmark, as Matplotlib reads it."""

COLOURS = ("#0072b2", "#d55e00", "#009e73", "#cc79a7", "#56b4e9", "#b8860b", "#4d4d4d")
"""Of Okabe and Ito's palette, which colour-blind readers can tell apart."""

_LINES = ("-", "--", ":", "-.")
_Styles = Mapping[str, dict[str, Any]]
_FORMATS = ("png", "svg", "pdf")
_NAMES_A_ROW = 2
_LINEAR_ITERATIONS = 100
_ITERATION_TICKS = (0, 50, 100, 300, 1000, 3000, 10_000)
_HEIGHTS_IN = (1.15, 1.15, 1.5)
_PATH_ASPECT = 1.25
_NAMES_IN = 0.12
_SURROUNDINGS = 0.15
"""Shown around start and goal, as a share of the distance between them."""


def method_styles(names: Iterable[str]) -> dict[str, dict[str, Any]]:
    """Colour and line of methods: known ones have theirs in every plot, others by position."""
    return {
        name: {"color": COLOURS[k % len(COLOURS)], "linestyle": _LINES[k // len(COLOURS) % 4]}
        for k, name in enumerate(dict.fromkeys([*METHODS, *names]))
    }


def file_of(figure: Figure, file_format: str) -> bytes:
    """The figure as ``png``, ``svg`` or ``pdf``; the same figure gives the same bytes of SVG."""
    buffer = io.BytesIO()
    metadata = {"Date": None} if file_format == "svg" else {}
    figure.savefig(buffer, format=file_format, metadata=metadata)
    return buffer.getvalue()


def controller_figure(records: Sequence[TrialRecord], file_format: str) -> bytes:
    """File (``png``, ``svg`` or ``pdf``) of the trials of one task, a line for every method."""
    with style.context(STYLE):
        return file_of(draw_controller(records), file_format)


def draw_controller(records: Sequence[TrialRecord]) -> Figure:
    """Figure of the trials of one task, in the style of Matplotlib's settings."""
    styles = method_styles(record.method for record in records)
    rows = -(-(len(records) + 1) // _NAMES_A_ROW)
    height_in = sum(_HEIGHTS_IN) + _NAMES_IN * rows
    figure = Figure(figsize=(COLUMN_IN, height_in), layout="constrained")
    panels = figure.subplot_mosaic(
        [["error"] * 2, ["linear", "angular"], ["above", "aside"]], height_ratios=_HEIGHTS_IN
    )
    _errors(panels["error"], records, styles)
    _speeds(panels["linear"], records, styles, slice(0, 3))
    _speeds(panels["angular"], records, styles, slice(3, 6))
    period = f"÷ {FRAME_PERIOD_S:g} s"
    panels["linear"].set(title="(b) Linear velocity", ylabel=f"m {period}")
    panels["angular"].set(title="(c) Angular velocity", ylabel=f"rad {period}")
    _paths((panels["above"], panels["aside"]), records, styles)
    lines, names = panels["above"].get_legend_handles_labels()
    figure.legend(lines, names, loc="outside lower center", ncols=_NAMES_A_ROW)
    return figure


def _errors(axes: Any, records: Sequence[TrialRecord], styles: _Styles) -> None:
    """Each method's own error, as a share of what it was at the start."""
    for record in records:
        errors = [step.error for step in record.trial.steps]
        known = np.array([np.nan if e is None else e for e in errors], dtype=np.float64)
        first = known[np.isfinite(known)][:1]
        if first.size and first[0] > 0:
            axes.semilogy(known / first[0], **styles[record.method])
    axes.set_title("(a) Feature or photometric error ÷ its first value")
    _iterations(axes)


def _speeds(axes: Any, records: Sequence[TrialRecord], styles: _Styles, part: slice) -> None:
    """Length of the linear or angular velocity."""
    for record in records:
        velocities = np.array([step.velocity for step in record.trial.steps])[:, part]
        axes.plot(np.linalg.norm(velocities, axis=1), **styles[record.method])
    axes.set_ylim(bottom=0)
    _iterations(axes)


def _iterations(axes: Any) -> None:
    """Axis of iterations; from a hundred on its scale is logarithmic: some take thousands."""
    axes.set_xscale("symlog", linthresh=_LINEAR_ITERATIONS)
    axes.set_xlim(left=0)
    low, high = axes.get_xlim()
    ticks = [tick for tick in _ITERATION_TICKS if low <= tick <= high]
    axes.set_xticks(ticks, [str(tick) for tick in ticks])
    axes.xaxis.set_minor_locator(NullLocator())
    axes.set_xlabel("iteration", labelpad=1)


def _paths(panels: tuple[Any, Any], records: Sequence[TrialRecord], styles: _Styles) -> None:
    """Paths seen from above, and from the side of the straight line from start to goal."""
    above, aside = panels
    goal = np.array(records[0].goal).reshape(4, 4)[:3, 3]
    start = records[0].trial.steps[0].position_m - goal
    along = start[:2] / min(-float(np.linalg.norm(start[:2])), -1e-9)

    def seen(path: FloatArray) -> tuple[FloatArray, FloatArray]:
        flat = np.stack([path[..., 1], path[..., 0]], axis=-1)
        return flat, np.stack([path[..., :2] @ along, -path[..., 2]], axis=-1)

    for axes, ends in zip((above, aside), seen(np.stack([start, np.zeros(3)])), strict=True):
        x, y = ends.mean(axis=0)
        reach = (0.5 + _SURROUNDINGS) * max(float(np.linalg.norm(start)), 1e-3)
        axes.set_xlim(x - _PATH_ASPECT * reach, x + _PATH_ASPECT * reach)
        axes.set_ylim(y - reach, y + reach)
        axes.set_aspect("equal")
        axes.xaxis.set_major_locator(MaxNLocator(3))
        axes.yaxis.set_major_locator(MaxNLocator(3))
    for record in records:
        path = np.array([step.position_m for step in record.trial.steps]) - goal
        for axes, line in zip((above, aside), seen(path), strict=True):
            axes.plot(*line.T, label=record.method, **styles[record.method])
    for axes in (above, aside):
        axes.plot(0, 0, "*", color="black", markersize=7, label="goal")
    above.set_title("(d) From above (m)")
    aside.set_title("(e) From the side (m)")
    above.set_xlabel("east")
    above.set_ylabel("north")
    aside.set_xlabel("towards the goal")
    aside.set_ylabel("up")


def figure_format(option: str, path: Path) -> str:
    """Format of the figure that an option names: ``png``, ``svg`` or ``pdf``.

    Raises
    ------
    ConfigError
        If the name ends in anything else.
    """
    ending = path.suffix.lower().lstrip(".")
    if ending not in _FORMATS:
        raise ConfigError(f"{option} is {str(path)!r}", "a name that ends in .png, .svg or .pdf")
    return ending
