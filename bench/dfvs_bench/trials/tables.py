"""What trials amount to: a summary for machines, rows for a table, and lines for people."""

import csv
import math
from collections.abc import Iterable, Sequence
from pathlib import Path
from typing import Any

from dfvs_bench.trials.perturbation import PERTURBATIONS
from dfvs_bench.trials.results import TrialRecord
from dfvs_bench.trials.statistics import mean, rounded
from dfvs_core.errors import ConfigError

HEADER = (
    "method               converged  iterations  to 4 cm, 1°  path ratio  final error   of depth"
)
_DIGITS = 5


def row(record: TrialRecord) -> dict[str, Any]:
    """One trial as a flat row."""
    trial, (distance_m, angle_rad) = record.trial, record.initial_error
    return {
        "task": record.task,
        "difficulty": record.difficulty,
        "method": record.method,
        "perturbation": record.perturbation,
        "matcher": record.matcher,
        "network": record.network,
        "initial_translation_m": round(distance_m, _DIGITS),
        "initial_rotation_deg": round(math.degrees(angle_rad), _DIGITS),
        "translation_m": round(trial.final.distance_m, _DIGITS),
        "rotation_deg": round(math.degrees(trial.final.angle_rad), _DIGITS),
        "median_depth_m": rounded(record.median_depth_m, _DIGITS),
        "translation_over_depth": rounded(record.final_share, _DIGITS),
        "path_m": round(trial.path_m, _DIGITS),
        "path_ratio": rounded(trial.path_ratio, _DIGITS),
        "iterations": trial.iterations,
        "iterations_to_criterion": trial.iterations_to_criterion,
        "converged": trial.converged,
        "false_done": trial.is_false_done,
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
    """Summary by method, and the same by perturbation where there are any (``perturbed``).

    Means of iterations and path ratio are over the trials that converged; means of the final
    errors over those and over all (``_all``), since a method that fails is far off.
    """
    rows = [row(record) for record in records]
    found = {r["perturbation"] for r in rows}
    names = [name for name in PERTURBATIONS if name in found]
    summary = {"methods": _by_method(rows, methods, "")}
    perturbed = {name: {"methods": _by_method(rows, methods, name)} for name in names}
    return summary | ({"perturbed": perturbed} if perturbed else {})


def _by_method(
    rows: list[dict[str, Any]], methods: Sequence[str], perturbation: str
) -> dict[str, Any]:
    rows = [r for r in rows if r["perturbation"] == perturbation]
    by_method = {name: [r for r in rows if r["method"] == name] for name in methods}
    return {name: _summary(group) for name, group in by_method.items() if group}


def _summary(rows: list[dict[str, Any]]) -> dict[str, Any]:
    good = [r for r in rows if r["converged"]]
    return {
        "scenes": len(rows),
        "converged": len(good),
        "false_done": sum(r["false_done"] for r in rows),
        "mean_iterations": _mean(good, "iterations"),
        "mean_iterations_to_criterion": _mean(good, "iterations_to_criterion"),
        "mean_path_ratio": _mean(good, "path_ratio"),
        "mean_translation_m": _mean(good, "translation_m"),
        "mean_rotation_deg": _mean(good, "rotation_deg"),
        "mean_translation_over_depth": _mean(good, "translation_over_depth"),
        "mean_translation_m_all": _mean(rows, "translation_m"),
        "mean_rotation_deg_all": _mean(rows, "rotation_deg"),
        "mean_translation_over_depth_all": _mean(rows, "translation_over_depth"),
        "per_scene": {r["task"]: r for r in sorted(rows, key=lambda r: str(r["task"]))},
    }


def _mean(rows: list[dict[str, Any]], key: str) -> float | None:
    return rounded(mean([r[key] for r in rows]), _DIGITS)


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
    perturbation = record.perturbation and f"{record.perturbation:<18}"
    return (
        f"{record.task:<18} {record.method:<19} "
        f"{perturbation}{distance_m:5.2f} m {math.degrees(angle_rad):5.1f}°"
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
        error = f"{1e3 * s['mean_translation_m']:.1f} mm, {s['mean_rotation_deg']:.2f}°"
        lines.append(
            f"{name:<20} {share:>9}  {s['mean_iterations']:>10.0f}"
            f"  {s['mean_iterations_to_criterion']:>11.0f}  {ratio_text(s['mean_path_ratio']):>10}"
            f"  {error:<14}  {share_text(s['mean_translation_over_depth'])}"
        )
    return lines


def share_text(share: float | None) -> str:
    """A share of the median depth, in percent, for people."""
    return "–" if share is None else f"{share:.2%}"


def perturbed_table(summary: dict[str, Any]) -> tuple[list[str], list[list[str]]]:
    """Head and rows of convergence without and with each perturbation, and with all of them."""
    perturbed = {name: s["methods"] for name, s in summary["perturbed"].items()}
    head = ["method", "without", *perturbed, "all of these"]
    rows = []
    for method in summary["methods"]:
        groups = [methods[method] for methods in perturbed.values() if method in methods]
        pooled = {key: sum(group[key] for group in groups) for key in ("converged", "scenes")}
        found = [summary["methods"], *perturbed.values(), {method: pooled}]
        rows.append([method, *(_converged(methods.get(method)) for methods in found)])
    return head, rows


def _converged(group: dict[str, Any] | None) -> str:
    return f"{group['converged']} of {group['scenes']}" if group and group["scenes"] else "–"


def perturbed_lines(summary: dict[str, Any]) -> list[str]:
    """Convergence without and with perturbations for people; none where there are none."""
    if "perturbed" not in summary:
        return []
    head, rows = perturbed_table(summary)
    widths = [max(len(line[k]) for line in (head, *rows)) + 2 for k in range(len(head))]
    lines = [
        line[0].ljust(widths[0])
        + "".join(cell.rjust(width) for cell, width in zip(line[1:], widths[1:], strict=True))
        for line in (head, *rows)
    ]
    return [*lines, ""]
