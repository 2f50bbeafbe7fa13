"""What trials amount to: a summary for machines, rows for a table, and lines for people."""

from __future__ import annotations

import csv
import math
from collections.abc import Iterable, Sequence
from pathlib import Path
from typing import Any

import numpy as np

from dfvs_core.errors import ConfigError
from dfvs_sim.bench.results import TrialRecord

HEADER = "method               converged  iterations  to 4 cm, 1°  path ratio  final error"
_DIGITS = 5


def row(record: TrialRecord) -> dict[str, Any]:
    """One trial as a flat row."""
    trial, (distance_m, angle_rad) = record.trial, record.initial_error
    return {
        "task": record.task,
        "difficulty": record.difficulty,
        "method": record.method,
        "matcher": record.matcher,
        "initial_translation_m": round(distance_m, _DIGITS),
        "initial_rotation_deg": round(math.degrees(angle_rad), _DIGITS),
        "translation_m": round(trial.final.distance_m, _DIGITS),
        "rotation_deg": round(math.degrees(trial.final.angle_rad), _DIGITS),
        "path_m": round(trial.path_m, _DIGITS),
        "path_ratio": None if trial.path_ratio is None else round(trial.path_ratio, _DIGITS),
        "iterations": trial.iterations,
        "iterations_to_criterion": trial.iterations_to_criterion,
        "converged": trial.converged,
        "end": trial.end,
        "most_iterations": record.most_iterations,
        "width": record.size[0],
        "height": record.size[1],
        "seconds": round(record.seconds, 1),
        "seed": record.seed,
        "inputs": record.inputs[:12],
        "version": record.version,
        "revision": record.revision,
    }


def summarise(records: Iterable[TrialRecord], methods: Sequence[str]) -> dict[str, Any]:
    """Summary by method.

    Means of iterations and path ratio are over the trials that converged; means of the final
    errors over those and over all (``_all``), since a method that fails is far off.
    """
    rows = [row(record) for record in records]
    by_method = {name: [r for r in rows if r["method"] == name] for name in methods}
    return {"methods": {name: _summary(group) for name, group in by_method.items() if group}}


def _summary(rows: list[dict[str, Any]]) -> dict[str, Any]:
    good = [r for r in rows if r["converged"]]
    return {
        "scenes": len(rows),
        "converged": len(good),
        "mean_iterations": _mean(good, "iterations"),
        "mean_iterations_to_criterion": _mean(good, "iterations_to_criterion"),
        "mean_path_ratio": _mean(good, "path_ratio"),
        "mean_translation_m": _mean(good, "translation_m"),
        "mean_rotation_deg": _mean(good, "rotation_deg"),
        "mean_translation_m_all": _mean(rows, "translation_m"),
        "mean_rotation_deg_all": _mean(rows, "rotation_deg"),
        "per_scene": {r["task"]: r for r in sorted(rows, key=lambda r: str(r["task"]))},
    }


def _mean(rows: list[dict[str, Any]], key: str) -> float | None:
    known = [r[key] for r in rows if r[key] is not None]
    return round(float(np.mean(known)), _DIGITS) if known else None


def write_rows(path: Path, rows: Sequence[dict[str, Any]]) -> None:
    """Write a table (CSV) of rows that all have the same columns.

    Raises
    ------
    ConfigError
        If the file cannot be written.
    """
    try:
        with path.open("w", newline="", encoding="utf-8") as file:
            writer = csv.DictWriter(file, fieldnames=list(rows[0]) if rows else [])
            writer.writeheader()
            writer.writerows(rows)
    except OSError as error:
        raise ConfigError(
            f"--csv {path} cannot be written ({error.strerror})", "a file in an existing folder"
        ) from error


def trial_line(record: TrialRecord) -> str:
    """One trial for people."""
    trial, (distance_m, angle_rad) = record.trial, record.initial_error
    mark = "  " if trial.converged else "NC"
    return (
        f"{record.task:<18} {record.method:<19} {distance_m:5.2f} m {math.degrees(angle_rad):5.1f}°"
        f" -> {1e3 * trial.final.distance_m:7.1f} mm {math.degrees(trial.final.angle_rad):6.2f}° "
        f"{mark} {trial.iterations:>5} iterations, path {ratio_text(trial.path_ratio)}, {trial.end}"
    )


def ratio_text(ratio: float | None) -> str:
    """Path over the straight line, for people."""
    return "   -" if ratio is None else f"{ratio:4.2f}"


def summary_lines(summary: dict[str, Any]) -> list[str]:
    """The summary for people; a dash where nothing converged."""
    lines = [HEADER]
    for name, s in summary["methods"].items():
        share = f"{s['converged']:>2} of {s['scenes']}"
        if not s["converged"]:
            lines.append(f"{name:<20} {share:>9}           -            -           -  -")
            continue
        lines.append(
            f"{name:<20} {share:>9}  {s['mean_iterations']:>10.0f}"
            f"  {s['mean_iterations_to_criterion']:>11.0f}  {ratio_text(s['mean_path_ratio']):>10}"
            f"  {1e3 * s['mean_translation_m']:.1f} mm, {s['mean_rotation_deg']:.2f}°"
        )
    return lines
