"""What flights amount to: a summary for machines, rows for a table, and lines for people."""

from collections.abc import Sequence
from dataclasses import asdict
from typing import Any

from dfvs_bench.drone.records import FlightRecord
from dfvs_bench.trials.statistics import largest, mean, rounded
from dfvs_core.messages.schema import dump

HEADER = (
    f"{'task':<18} {'start':>13} {'bound':>7} {'within':>8} {'ratio':>6} {'done':>8} {'ratio':>6}"
    f"  {'final error':<17} end"
)
_DIGITS = 4


def row(record: FlightRecord) -> dict[str, Any]:
    """One flight as a flat row; times in s, ratios over the bound."""
    values = asdict(record)
    for nested in ("limits", "bound", "start", "goal", "size", "service"):
        values.pop(nested)
    return {
        "translation_m": rounded(values.pop("final_translation_m"), _DIGITS),
        "rotation_deg": rounded(values.pop("final_rotation_deg"), _DIGITS),
        **{k: round(v, _DIGITS) if isinstance(v, float) else v for k, v in values.items()},
        "bound_s": round(record.bound.least_s, _DIGITS),
        "bound_way_s": round(record.bound.way_s, _DIGITS),
        "bound_turn_s": round(record.bound.turn_s, _DIGITS),
        "within_ratio": rounded(record.within_ratio, _DIGITS),
        "motion_ratio": rounded(record.motion_ratio, _DIGITS),
        "done_ratio": rounded(record.done_ratio, _DIGITS),
        "width": record.size[0],
        "height": record.size[1],
        "service": " ".join(record.service),
    }


def summarise(records: Sequence[FlightRecord]) -> dict[str, Any]:
    """Summary: means are over the flights that converged, and None without any."""
    good = [record for record in records if record.converged]
    return {
        "scenes": len(records),
        "converged": len(good),
        "mean_iterations": None,  # a flight has none
        "mean_bound_s": _mean([r.bound.least_s for r in good]),
        "mean_within_s": _mean([r.within_s for r in good]),
        "mean_within_ratio": _mean([r.within_ratio for r in good]),
        "worst_within_ratio": _worst([r.within_ratio for r in good]),
        "mean_motion_ratio": _mean([r.motion_ratio for r in good]),
        "worst_motion_ratio": _worst([r.motion_ratio for r in good]),
        "mean_done_s": _mean([r.done_s for r in good]),
        "mean_done_ratio": _mean([r.done_ratio for r in good]),
        "worst_done_ratio": _worst([r.done_ratio for r in good]),
        "mean_translation_m": _mean([r.final_translation_m for r in good]),
        "mean_rotation_deg": _mean([r.final_rotation_deg for r in good]),
        "mean_path_ratio": _mean([r.path_ratio for r in good]),
        "limits": dump(records[0].limits) if records else None,
        "per_scene": {r.task: row(r) for r in records},
    }


def flight_line(record: FlightRecord) -> str:
    """One flight for people."""
    start = f"{record.initial_translation_m:.2f} m {record.initial_rotation_deg:.1f}°"
    line = f"{record.task:<18} {start:>13} {record.bound.least_s:>5.1f} s"
    line += f" {_seconds(record.within_s)} {_ratio(record.within_ratio)}"
    line += f" {_seconds(record.done_s)} {_ratio(record.done_ratio)}"
    if record.final_translation_m is None or record.final_rotation_deg is None:
        final = "-"
    else:
        final = f"{1e3 * record.final_translation_m:.1f} mm {record.final_rotation_deg:.2f}°"
    cause = " ".join(record.end_cause.split())
    end = "converged" if record.converged else f"{record.end_state}: {cause}"
    return f"{line}  {final:<17} {end}"


def summary_line(summary: dict[str, Any]) -> str:
    """The summary for people."""
    line = f"{summary['converged']} of {summary['scenes']} converged"
    if not summary["converged"]:
        return line
    return (
        f"{line}; within 5 cm and 1° after {_times(summary, 'within')}, from the first motion on "
        f"{_times(summary, 'motion')}; done after {_times(summary, 'done')}"
    )


def _times(summary: dict[str, Any], what: str) -> str:
    mean, worst = summary[f"mean_{what}_ratio"], summary[f"worst_{what}_ratio"]
    return "-" if mean is None else f"{mean:.2f} times the bound (worst {worst:.2f})"


def _seconds(value: float | None) -> str:
    return f"{'-':>8}" if value is None else f"{value:>6.1f} s"


def _ratio(value: float | None) -> str:
    return f"{'-':>6}" if value is None else f"{value:>6.2f}"


def _mean(values: Sequence[float | None]) -> float | None:
    return rounded(mean(values), _DIGITS)


def _worst(values: Sequence[float | None]) -> float | None:
    return rounded(largest(values), _DIGITS)
