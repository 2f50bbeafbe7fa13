"""Plots of trials, as in the paper's Fig. 5: error, velocities, and the camera's path."""

from __future__ import annotations

import io
from collections.abc import Sequence
from typing import Any

import matplotlib as mpl
import numpy as np
from matplotlib.figure import Figure
from matplotlib.ticker import MaxNLocator, NullLocator

from dfvs_sim.bench.results import TrialRecord

STYLE: Any = {
    "font.size": 9,
    "axes.spines.top": False,
    "axes.spines.right": False,
    "axes.grid": True,
    "grid.alpha": 0.3,
    "axes.titlesize": 10,
    "legend.frameon": False,
}
"""Matplotlib settings of all plots of the benchmark."""

_FORMATS = ("png", "svg", "pdf")
_NAMES_A_ROW = 5
_LINEAR_ITERATIONS = 100
_ITERATION_TICKS = (0, 20, 40, 60, 80, 100, 200, 500, 1000, 2000, 4000, 10_000)


def controller_figure(records: Sequence[TrialRecord], file_format: str = "png") -> bytes:
    """Plot the trials of one task, a line for every method.

    Parameters
    ----------
    records : sequence of TrialRecord
        Of the same task.
    file_format : str
        ``png``, ``svg`` or ``pdf``.

    Returns
    -------
    bytes
        The file.
    """
    with mpl.rc_context(STYLE):
        figure = Figure(figsize=(11, 7.2), layout="constrained")
        grid = figure.add_gridspec(2, 2)
        _errors(figure.add_subplot(grid[0, 0]), records)
        _speeds(figure.add_subplot(grid[0, 1]), records, slice(0, 3), "Translation (m/s)")
        _speeds(figure.add_subplot(grid[1, 0]), records, slice(3, 6), "Rotation (rad/s)")
        _paths(figure.add_subplot(grid[1, 1], projection="3d"), records)
        lines, names = figure.axes[1].get_legend_handles_labels()
        figure.legend(lines, names, loc="outside lower center", ncols=_NAMES_A_ROW)
        buffer = io.BytesIO()
        figure.savefig(buffer, format=file_format, dpi=100)
    return buffer.getvalue()


def _errors(axes: Any, records: Sequence[TrialRecord]) -> None:
    """Each method's own error, as a share of what it was at the start."""
    for record in records:
        errors = [step.error for step in record.trial.steps]
        known = np.array([np.nan if e is None else e for e in errors], dtype=np.float64)
        first = known[np.isfinite(known)][:1]
        if first.size and first[0] > 0:
            axes.semilogy(known / first[0], label=record.method)
    axes.set_title("Feature or photometric error ÷ its first value", loc="left")
    _iterations(axes)


def _speeds(axes: Any, records: Sequence[TrialRecord], part: slice, title: str) -> None:
    """Length of the linear or angular velocity."""
    for record in records:
        velocities = np.array([step.velocity for step in record.trial.steps])[:, part]
        axes.plot(np.linalg.norm(velocities, axis=1), label=record.method)
    axes.set_title(title, loc="left")
    _iterations(axes)


def _iterations(axes: Any) -> None:
    """Axis of iterations; from a hundred on its scale is logarithmic: some take thousands."""
    axes.set_xscale("symlog", linthresh=_LINEAR_ITERATIONS)
    axes.set_xlim(left=0)
    low, high = axes.get_xlim()
    ticks = [tick for tick in _ITERATION_TICKS if low <= tick <= high]
    axes.set_xticks(ticks, [str(tick) for tick in ticks])
    axes.xaxis.set_minor_locator(NullLocator())
    axes.set_xlabel("iteration")


def _paths(axes: Any, records: Sequence[TrialRecord]) -> None:
    for record in records:
        north, east, down = np.array([step.position_m for step in record.trial.steps]).T
        axes.plot(east, north, -down, label=record.method)
    goal = np.array(records[0].goal).reshape(4, 4)[:3, 3]
    axes.scatter(goal[1], goal[0], -goal[2], marker="*", s=90, color="black", label="goal")
    axes.set_title("Camera path (m): east, north, up", loc="left")
    axes.set_aspect("equal")
    for axis in (axes.xaxis, axes.yaxis, axes.zaxis):
        axis.set_major_locator(MaxNLocator(3))


def is_figure_name(suffix: str) -> bool:
    """Tell whether a file name's ending names a format that can be written."""
    return suffix.lower().lstrip(".") in _FORMATS
