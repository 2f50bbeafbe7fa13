"""Time series of a flight, from the records that its black box kept."""

from __future__ import annotations

import math
from collections.abc import Iterable, Iterator
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

from dfvs_core.errors import WireError
from dfvs_core.gate.config import S
from dfvs_core.gate.events import Attitude, Event, LocalPosition, Report
from dfvs_core.gate.replay import Step, read_start, read_steps
from dfvs_service.flights import layout
from dfvs_service.flights.records import read_lines

Samples = list[tuple[float, float]]
"""Time in s from the start of the flight, and value; NaN interrupts a curve."""
Vector = tuple[float, float, float]

_GAP_S = 0.5
"""A longer time between two samples interrupts a curve."""


@dataclass(slots=True)
class FlightSeries:
    """Curves of a flight.

    ``commanded`` and ``flown`` hold forward, right and down in m/s in the level body frame;
    ``path`` holds north and east in m relative to the first position.
    """

    commanded: tuple[Samples, Samples, Samples] = field(default_factory=lambda: ([], [], []))
    flown: tuple[Samples, Samples, Samples] = field(default_factory=lambda: ([], [], []))
    error_m: Samples = field(default_factory=list)
    error_deg: Samples = field(default_factory=list)
    from_start_m: Samples = field(default_factory=list)
    height_m: Samples = field(default_factory=list)
    overlap: Samples = field(default_factory=list)
    latency_ms: Samples = field(default_factory=list)
    path: list[tuple[float, float]] = field(default_factory=list)


def read_series(folder: Path, start_ns: int) -> FlightSeries:
    """Curves of the flight in a folder, as far as its records go; ``start_ns`` is time 0."""
    series = FlightSeries()
    builder = _Builder(series, start_ns)
    for step in _steps(folder / layout.GATE_INPUTS):
        builder.add(step)
    for record in _telemetry(folder, "servo"):
        try:
            done_ns, capture_ns = int(record["t_ns"]), int(record["t_capture_ns"])
        except (KeyError, TypeError, ValueError):
            continue
        _append(series.latency_ms, (done_ns - start_ns) / S, (done_ns - capture_ns) * 1e-6)
    return series


def last_timing(folder: Path) -> dict[str, Any]:
    """Newest summary of perception's stages: name to p50 and p99 in ms; empty without one."""
    stages: dict[str, Any] = {}
    for record in _telemetry(folder, "timing"):
        found = record.get("stages")
        stages = found if isinstance(found, dict) else stages
    return stages


class _Builder:
    """Takes the gate's steps, oldest first."""

    def __init__(self, series: FlightSeries, start_ns: int) -> None:
        self._series = series
        self._start_ns = start_ns
        self._yaw_rad = 0.0
        self._origin: Vector | None = None

    def add(self, step: Step) -> None:
        """Take a step."""
        for event in step.events:
            self._take(event)
        velocity = step.said.get("v")
        if isinstance(velocity, list):
            for curve, value in zip(self._series.commanded, velocity, strict=False):
                _append(curve, self._s(step.t_ns), float(value))

    def _take(self, event: Event) -> None:
        series, t_s = self._series, self._s(event.t_ns)
        if isinstance(event, Attitude):
            self._yaw_rad = event.yaw_rad
        elif isinstance(event, LocalPosition):
            self._move(t_s, event.position_m, event.velocity_m_s)
        elif isinstance(event, Report):
            report, is_seen = event.report, event.report.healthy
            _append(series.error_m, t_s, report.error_m if is_seen else math.nan)
            _append(series.error_deg, t_s, math.degrees(report.error_rad) if is_seen else math.nan)
            _append(series.overlap, t_s, report.overlap if is_seen else math.nan)

    def _move(self, t_s: float, position_m: Vector, velocity_m_s: Vector) -> None:
        self._origin = position_m if self._origin is None else self._origin
        north, east, down = (a - b for a, b in zip(position_m, self._origin, strict=True))
        series = self._series
        series.path.append((north, east))
        _append(series.from_start_m, t_s, math.hypot(north, east, down))
        _append(series.height_m, t_s, -down)
        cos, sin = math.cos(self._yaw_rad), math.sin(self._yaw_rad)
        v_north, v_east, v_down = velocity_m_s
        level = (cos * v_north + sin * v_east, cos * v_east - sin * v_north, v_down)
        for curve, value in zip(series.flown, level, strict=True):
            _append(curve, t_s, value)

    def _s(self, t_ns: int) -> float:
        return (t_ns - self._start_ns) / S


def _append(curve: Samples, t_s: float, value: float) -> None:
    if curve and t_s - curve[-1][0] > _GAP_S:
        curve.append((t_s, math.nan))
    curve.append((t_s, value))


def _steps(path: Path) -> Iterator[Step]:
    """Steps of the gate up to a gap, a damaged line or the end."""
    try:
        with path.open(encoding="utf-8", errors="replace") as lines:
            read_start(next(lines, ""))
            yield from _before_gap(read_steps(lines))
    except (OSError, WireError):
        return


def _before_gap(steps: Iterable[Step | int]) -> Iterator[Step]:
    for step in steps:
        if isinstance(step, int):
            return
        yield step


def _telemetry(folder: Path, stream: str) -> Iterator[dict[str, Any]]:
    for path in sorted(folder.glob(f"{layout.TELEMETRY}-*.jsonl")):
        for record in read_lines(path):
            if record.get("stream") == stream and isinstance(record.get("data"), dict):
                yield record["data"]
