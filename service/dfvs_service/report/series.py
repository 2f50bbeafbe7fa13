"""Time series of a flight from its records."""

import bisect
import math
from collections import deque
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any

import numpy as np

from dfvs_core.gate.config import S
from dfvs_core.messages.link import PerceptionReport
from dfvs_service.page.charts import Interval, Samples

Vector = tuple[float, float, float]
Span = tuple[float, float]
"""First and last time, s."""

_GAP_S = 0.5
"""A longer time between two samples interrupts a curve."""
_LEAST_LATENCY_MS = 0.1
"""Latency of a frame that was stamped ahead of its time, since its plot is logarithmic."""
_YAW_SPAN_S = 0.3
"""The yaw rate is the change of the heading over so long."""


@dataclass(slots=True)
class Fault:
    """The same fault of one or more frames or events, from its first to its last time, s."""

    from_s: float
    to_s: float
    text: str
    count: int = 1


@dataclass(slots=True)
class FlightSeries:
    """Curves of a flight.

    ``commanded`` and ``flown`` hold forward, right and down in m/s and the yaw rate in rad/s, in
    the level body frame; ``path`` holds times, north and east in m from the first position.
    ``spread_m`` is the estimated distance minus and plus its standard deviation. ``true_m`` and
    ``true_deg`` are known of simulated flights. ``stages_ms`` holds the time that every frame took
    in each stage, by time.
    """

    commanded: tuple[Samples, ...] = field(default_factory=lambda: ([], [], [], []))
    flown: tuple[Samples, ...] = field(default_factory=lambda: ([], [], [], []))
    error_m: Samples = field(default_factory=list)
    error_deg: Samples = field(default_factory=list)
    spread_m: list[Interval] = field(default_factory=list)
    true_m: Samples = field(default_factory=list)
    true_deg: Samples = field(default_factory=list)
    from_start_m: Samples = field(default_factory=list)
    height_m: Samples = field(default_factory=list)
    overlap: Samples = field(default_factory=list)
    latency_ms: Samples = field(default_factory=list)
    path: list[tuple[float, float, float]] = field(default_factory=list)
    stages_ms: dict[str, Samples] = field(default_factory=dict)
    faults: list[Fault] = field(default_factory=list)

    def stage_percentiles(self, spans: Sequence[Span]) -> dict[str, tuple[float, float]]:
        """Median and 99th percentile of every stage in some spans of time, ms."""
        found = {}
        for name, samples in self.stages_ms.items():
            values = values_in(samples, spans)
            if values:
                p50, p99 = np.percentile(values, [50, 99])
                found[name] = (float(p50), float(p99))
        return found


def values_in(samples: Samples, spans: Sequence[Span]) -> list[float]:
    """Values in some spans of time, without NaN."""
    return [v for t, v in samples if math.isfinite(v) and any(a <= t <= b for a, b in spans)]


def value_at(samples: Samples, t_s: float) -> float:
    """Newest value at a time; NaN before the first one and where the curve is interrupted."""
    index = bisect.bisect_right(samples, t_s, key=lambda sample: sample[0])
    if not index or t_s - samples[index - 1][0] > _GAP_S:
        return math.nan
    return samples[index - 1][1]


class SeriesBuilder:
    """Takes what was recorded, oldest first of each kind.

    ``start_ns`` is time 0 of the curves.
    """

    def __init__(self, start_ns: int) -> None:
        self.series = FlightSeries()
        self._start_ns = start_ns
        self._yaw_rad = 0.0
        self._yaws: deque[tuple[float, float]] = deque()
        self._origin: Vector | None = None

    def set_start(self, start_ns: int) -> None:
        """Go on with another clock, on which time 0 of the curves is ``start_ns``."""
        self._start_ns = start_ns

    def add_setpoint(self, t_ns: int, velocity: tuple[float, float, float, float]) -> None:
        """Add a commanded velocity: forward, right, down, m/s; yaw rate, rad/s."""
        for curve, value in zip(self.series.commanded, velocity, strict=True):
            _append(curve, self._s(t_ns), float(value))

    def add_yaw(self, t_ns: int, yaw_rad: float) -> None:
        """Take the vehicle's heading."""
        t_s = self._s(t_ns)
        self._yaw_rad = yaw_rad
        self._yaws.append((t_s, yaw_rad))
        while t_s - self._yaws[0][0] > _YAW_SPAN_S:
            self._yaws.popleft()
        earlier_s, earlier_rad = self._yaws[0]
        if t_s - earlier_s > 0.5 * _YAW_SPAN_S:
            turned = math.remainder(yaw_rad - earlier_rad, math.tau)
            _append(self.series.flown[3], t_s, turned / (t_s - earlier_s))

    def add_position(self, t_ns: int, position_m: Vector, velocity_m_s: Vector) -> None:
        """Take the vehicle's position and velocity, NED."""
        t_s, series = self._s(t_ns), self.series
        self._origin = position_m if self._origin is None else self._origin
        north, east, down = (a - b for a, b in zip(position_m, self._origin, strict=True))
        series.path.append((t_s, north, east))
        _append(series.from_start_m, t_s, math.hypot(north, east, down))
        _append(series.height_m, t_s, -down)
        cos, sin = math.cos(self._yaw_rad), math.sin(self._yaw_rad)
        v_north, v_east, v_down = velocity_m_s
        level = (cos * v_north + sin * v_east, cos * v_east - sin * v_north, v_down)
        for curve, value in zip(series.flown[:3], level, strict=True):
            _append(curve, t_s, value)

    def add_report(self, t_ns: int, report: PerceptionReport) -> None:
        """Add a report of perception to the gate."""
        series, t_s, is_seen = self.series, self._s(t_ns), report.healthy
        _append(series.error_m, t_s, report.error_m if is_seen else math.nan)
        _append(series.error_deg, t_s, math.degrees(report.error_rad) if is_seen else math.nan)
        _append(series.overlap, t_s, report.overlap if is_seen else math.nan)
        if not is_seen:
            self.add_fault(t_ns, report.reason or "no valid frame")

    def add_fault(self, t_ns: int, text: str) -> None:
        """Take a fault; one that goes on is one fault."""
        t_s, faults = self._s(t_ns), self.series.faults
        for fault in reversed(faults):
            if t_s - fault.to_s > _GAP_S:
                break
            if fault.text == text:
                fault.to_s, fault.count = t_s, fault.count + 1
                return
        faults.append(Fault(t_s, t_s, text))

    def add_servo(self, document: Mapping[str, Any]) -> None:
        """Take perception's document about a frame; one that is damaged is left out."""
        try:
            t_s = self._s(int(document["t_ns"]))
            latency_ms = (int(document["t_ns"]) - int(document["t_capture_ns"])) * 1e-6
            stages = {str(k): float(v) for k, v in document.get("stages_ms", {}).items()}
            error, spread = (_number(document.get(k)) for k in ("error_m", "error_spread_m"))
        except (KeyError, TypeError, ValueError, AttributeError):
            return
        _append(self.series.latency_ms, t_s, max(latency_ms, _LEAST_LATENCY_MS))
        for name, value in stages.items():
            _append(self.series.stages_ms.setdefault(name, []), t_s, value)
        band = self.series.spread_m
        if band and t_s - band[-1][0] > _GAP_S:
            band.append((t_s, math.nan, math.nan))
        band.append((t_s, error - spread, error + spread))

    def _s(self, t_ns: int) -> float:
        return (t_ns - self._start_ns) / S


def _number(value: Any) -> float:
    """Number of a document, whose null stands for one that is not known."""
    return math.nan if value is None else float(value)


def _append(curve: Samples, t_s: float, value: float) -> None:
    if curve and t_s - curve[-1][0] > _GAP_S:
        curve.append((t_s, math.nan))
    curve.append((t_s, value))
