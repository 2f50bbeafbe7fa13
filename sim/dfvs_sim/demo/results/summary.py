"""The figures of a flight, as they go into ``summary.json``, and the table of several flights."""

import bisect
import itertools
import json
import math
from collections.abc import Mapping, Sequence
from dataclasses import asdict, dataclass, field
from pathlib import Path
from typing import Any

import numpy as np

from dfvs_common.atomic_file import replace_json
from dfvs_sim.demo.flight.engagement import READY, UNDER_WAY
from dfvs_sim.demo.flight.flight_log import FlightLog
from dfvs_sim.demo.flight.track import meets_criterion, path_length_m, settled_error
from dfvs_sim.demo.options import FlightOptions
from dfvs_sim.vehicle.record import read_record

NOT_READY = "NOT READY"
"""Instead of a gate's state, where a flight could not be brought up."""

_COLUMNS = (
    ("start m", "initial_translation_m", 1.0, "7.2f"),
    ("start deg", "initial_rotation_deg", 1.0, "9.1f"),
    ("final cm", "final_translation_m", 100.0, "8.2f"),
    ("final deg", "final_rotation_deg", 1.0, "9.2f"),
    ("time s", "duration_s", 1.0, "6.1f"),
    ("path", "path_ratio", 1.0, "4.2f"),
)
"""Heading, key in the summary, factor and format."""


@dataclass(frozen=True, slots=True)
class FlightSummary:
    """One flight in figures.

    ``converged``: the service says DONE, and the camera truly is within 5 cm and 1 degree.
    ``final_translation_m``, ``final_rotation_deg``: medians of the last half second before the
    pilot takes over, a second after the end.
    ``path_ratio``: length flown over the straight line. ``latency_ms``: from a frame's capture
    to the first setpoint after it that reached the vehicle, by the vehicle's record, p50 and p99
    (beside a foreign autopilot: to the report for the gate); ``stages_ms``: where that time went.
    ``max_setpoint_gap_ms``: by the simulated vehicle's
    own record, while engaged; None beside a foreign autopilot. ``states``: the gate's, in order.
    ``vehicle``: its name. ``estimate``, ``wind``: what the simulated vehicle was flown with; None
    beside a foreign autopilot. A flight that could not be brought up has no figures, and the end
    state ``NOT READY``.
    """

    converged: bool
    seed: int
    end_state: str
    end_cause: str
    initial_translation_m: float = math.nan
    initial_rotation_deg: float = math.nan
    final_translation_m: float = math.nan
    final_rotation_deg: float = math.nan
    duration_s: float = math.nan
    path_ratio: float = math.nan
    frames: int = 0
    latency_ms: dict[str, float] = field(default_factory=dict)
    stages_ms: dict[str, dict[str, float]] = field(default_factory=dict)
    max_setpoint_gap_ms: float | None = None
    states: list[str] = field(default_factory=list)
    vehicle: str = ""
    estimate: str | None = None
    wind: str | None = None

    def to_json(self) -> dict[str, Any]:
        """Mapping that JSON can hold: no NaN."""
        return {
            key: None if isinstance(value, float) and not math.isfinite(value) else value
            for key, value in asdict(self).items()
        }


def write_results(log: FlightLog, folder: Path) -> FlightSummary:
    """Write the summary and the servo's documents into the flight's folder."""
    summary = summarise(log)
    replace_json(folder / "summary.json", summary.to_json())
    lines = (json.dumps(document) + "\n" for document in log.watch.servo)
    (folder / "servo.jsonl").write_text("".join(lines), encoding="utf-8")
    return summary


def summarise(log: FlightLog) -> FlightSummary:
    """Figures of a flight; the truth is the vehicle's pose, not the service's estimate."""
    flown = log.flown
    initial_m, initial_rad = (
        (flown[0].error_m, flown[0].error_rad) if flown else (math.nan, math.nan)
    )
    final_m, final_rad = settled_error(log.judged)
    setpoints = _engaged_setpoints_ns(log)
    return FlightSummary(
        converged=log.end_state == "DONE" and meets_criterion(final_m, final_rad),
        seed=log.plan.seed,
        end_state=log.end_state,
        end_cause=log.end_cause,
        initial_translation_m=round(initial_m, 4),
        initial_rotation_deg=round(math.degrees(initial_rad), 3),
        final_translation_m=round(final_m, 4),
        final_rotation_deg=round(math.degrees(final_rad), 3),
        duration_s=round((log.ended_ns - log.engaged_ns) * 1e-9, 2),
        path_ratio=round(path_length_m(flown) / initial_m if flown else math.nan, 3),
        frames=len(log.watch.servo),
        latency_ms=_latency_ms(log, setpoints),
        stages_ms=log.watch.timing.get("stages", {}),
        max_setpoint_gap_ms=_max_setpoint_gap_ms(setpoints),
        states=[state for t_ns, state in log.watch.states if t_ns <= log.ended_ns],
        vehicle=log.options.vehicle,
        estimate=log.options.estimate,
        wind=log.options.wind,
    )


def write_not_flown(seed: int, options: FlightOptions, cause: str, folder: Path) -> FlightSummary:
    """Write the summary of a flight that could not be brought up."""
    summary = FlightSummary(
        converged=False,
        seed=seed,
        end_state=NOT_READY,
        end_cause=cause,
        vehicle=options.vehicle,
        estimate=options.estimate,
        wind=options.wind,
    )
    replace_json(folder / "summary.json", summary.to_json())
    (folder / "servo.jsonl").unlink(missing_ok=True)  # of an earlier flight
    return summary


def _engaged_setpoints_ns(log: FlightLog) -> list[int] | None:
    """When setpoints reached the vehicle while engaged, by its own record."""
    if log.vehicle_record is None:
        return None
    end_ns = log.ended_ns
    for t_ns, state in log.watch.states:
        if t_ns > log.engaged_ns and state not in READY | UNDER_WAY:
            end_ns = t_ns
            break
    return [
        event["t_ns"]
        for event in read_record(log.vehicle_record)
        if event["kind"] == "setpoint" and log.engaged_ns <= event["t_ns"] <= end_ns
    ]


def _max_setpoint_gap_ms(setpoints: list[int] | None) -> float | None:
    """Longest pause between setpoints."""
    if setpoints is None or len(setpoints) < 2:
        return None
    return round(max(b - a for a, b in itertools.pairwise(setpoints)) * 1e-6, 2)


def _latency_ms(log: FlightLog, setpoints: list[int] | None) -> dict[str, float]:
    """p50 and p99 of the time from capture to the setpoint that follows the frame's report."""
    if not setpoints:
        stage = log.watch.timing.get("stages", {}).get("capture_to_report", {})
        return {"p50": stage.get("p50_ms", 0.0), "p99": stage.get("p99_ms", 0.0)}
    latencies = []
    for document in log.watch.servo:
        i = bisect.bisect_left(setpoints, document["t_ns"])
        if document["t_capture_ns"] >= log.engaged_ns and i < len(setpoints):
            latencies.append((setpoints[i] - document["t_capture_ns"]) * 1e-6)
    p50, p99 = np.percentile(latencies, [50, 99]) if latencies else (0.0, 0.0)
    return {"p50": round(float(p50), 2), "p99": round(float(p99), 2)}


def flight_table(documents: Sequence[Mapping[str, Any]]) -> str:
    """Table of summaries as JSON has them, a line each, and how many converged."""
    width = max([len("vehicle"), *(len(str(d["vehicle"])) for d in documents)])
    head = "  ".join(heading for heading, *_ in _COLUMNS)
    lines = [f"{'vehicle':<{width}}  seed  {head}  end"]
    for document in documents:
        cells = [_cell(document.get(key), factor, form) for _, key, factor, form in _COLUMNS]
        end = "converged" if document["converged"] else document["end_state"]
        if end == NOT_READY:
            end += f": {' '.join(document['end_cause'].split())}"
        lines.append(
            f"{document['vehicle']:<{width}}  {document['seed']:4d}  {'  '.join(cells)}  {end}"
        )
    converged = sum(bool(document["converged"]) for document in documents)
    return "\n".join([*lines, f"{converged} of {len(documents)} converged"])


def _cell(value: float | None, factor: float, form: str) -> str:
    if value is None:
        return "-".rjust(int(form.partition(".")[0]))
    return format(factor * value, form)
