"""Plots of a soak: memory, descriptors, threads and latency over time."""

from pathlib import Path
from typing import Any

from matplotlib.figure import Figure

from dfvs_robustness.soak.sampling import Sample

_COLOURS = {
    "gate": "#2563a8",
    "perception": "#d97706",
    "parent": "#2f8f4e",
    "operator link": "#9333a8",
    "black box": "#4b5563",
    "recorder": "#b91c1c",
}


def write_plots(samples: list[Sample], path: Path) -> None:
    """Write one figure with four plots."""
    figure = Figure(figsize=(11, 6.5), layout="constrained")
    grid = figure.subplots(2, 2)
    _lines(grid[0, 0], samples, "own_mb", "Own memory", "MB above the least")
    _lines(grid[0, 1], samples, "descriptors", "File descriptors", "open")
    _lines(grid[1, 0], samples, "threads", "Threads", "running")
    _latency(grid[1, 1], samples)
    figure.savefig(path, dpi=110)


def _lines(axes: Any, samples: list[Sample], name: str, title: str, unit: str) -> None:
    for role, pid in sorted({(s.role, s.pid) for s in samples}):
        own = [s for s in samples if s.pid == pid]
        values, label = [float(getattr(s, name)) for s in own], role
        if name == "own_mb":
            least = min(values)
            values = [value - least for value in values]
            label = f"{role}, from {least:.0f} MB"
        axes.plot([s.t_s / 60.0 for s in own], values, color=_COLOURS[role], label=label)
    axes.set_title(title, loc="left")
    axes.set_xlabel("min")
    axes.set_ylabel(unit)
    axes.legend(frameon=False)
    axes.grid(alpha=0.3)


def _latency(axes: Any, samples: list[Sample]) -> None:
    told = [s for s in samples if s.latency_p50_ms is not None]
    t = [s.t_s / 60.0 for s in told]
    axes.plot(t, [s.latency_p99_ms for s in told], color=_COLOURS["perception"], label="p99")
    axes.plot(t, [s.latency_p50_ms for s in told], color=_COLOURS["gate"], label="p50")
    axes.set_title("Capture to report", loc="left")
    axes.set_xlabel("min")
    axes.set_ylabel("ms")
    axes.set_ylim(bottom=0)
    axes.legend(frameon=False)
    axes.grid(alpha=0.3)
