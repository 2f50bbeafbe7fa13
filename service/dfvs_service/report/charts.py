"""Charts as SVG: curves over time above a line of the gate's states, and a path from above."""

from __future__ import annotations

import html
import math
from collections.abc import Sequence
from dataclasses import dataclass

from dfvs_service.flights.records import StateChange
from dfvs_service.report.series import Samples

_WIDTH, _HEIGHT = 1000, 230
_LEFT, _RIGHT, _TOP, _STATES, _BOTTOM = 82, 14, 12, 18, 24
_TICKS = 4
_MOST_POINTS = 1500
_LABEL_PX = 52
"""A state that is shown narrower than this has no label, only a tooltip."""


@dataclass(frozen=True, slots=True)
class TimeLine:
    """Span of time in s that all charts show, with the gate's states in it."""

    from_s: float
    to_s: float
    states: tuple[StateChange, ...]

    def x(self, t_s: float) -> float:
        """Place of a time, px."""
        share = (t_s - self.from_s) / max(self.to_s - self.from_s, 1e-9)
        return _LEFT + share * (_WIDTH - _LEFT - _RIGHT)

    def shows(self, t_s: float) -> bool:
        """Whether a time lies in the span."""
        return self.from_s <= t_s <= self.to_s


@dataclass(frozen=True, slots=True)
class Curve:
    """Samples with the CSS class that they are drawn in."""

    style: str
    samples: Samples


def time_chart(curves: Sequence[Curve], line: TimeLine, unit: str) -> str:
    """SVG of curves over time; empty where there is nothing to show."""
    shown = [Curve(c.style, [s for s in c.samples if line.shows(s[0])]) for c in curves]
    values = [v for c in shown for _, v in c.samples if math.isfinite(v)]
    if not values:
        return ""
    low, high = _range(min(*values, 0.0), max(*values, 0.0))
    bottom = _HEIGHT - _BOTTOM - _STATES

    def y(value: float) -> float:
        return bottom - (value - low) / (high - low) * (bottom - _TOP)

    parts = [_y_axis(low, high, y(low), y(high), unit), _x_axis(line), _state_line(line, bottom)]
    for curve in shown:
        for run in _runs(curve.samples):
            points = " ".join(f"{line.x(t):.1f},{y(v):.1f}" for t, v in _thinned(run))
            parts.append(f'<polyline class="{curve.style}" points="{points}"/>')
    return _svg(_WIDTH, _HEIGHT, parts)


def path_chart(path: Sequence[tuple[float, float]]) -> str:
    """SVG of (north, east) in m seen from above, north up, with one scale; empty without points."""
    points = [(n, e) for n, e in path if math.isfinite(n) and math.isfinite(e)]
    if not points:
        return ""
    norths, easts = zip(*points, strict=True)
    span = max(max(norths) - min(norths), max(easts) - min(easts), 0.5) * 1.2
    size, centre = 420, ((max(norths) + min(norths)) / 2, (max(easts) + min(easts)) / 2)

    def place(point: tuple[float, float]) -> tuple[float, float]:
        return (
            size * (0.5 + (point[1] - centre[1]) / span),
            size * (0.5 - (point[0] - centre[0]) / span),
        )

    step = _nice(span / 4)
    places = [place(p) for p in _thinned(points)]
    line = " ".join(f"{x:.1f},{y:.1f}" for x, y in places)
    (x0, y0), (x1, y1) = place(points[0]), place(points[-1])
    scale = size * step / span
    parts = [
        f'<rect class="frame" x="0" y="0" width="{size}" height="{size}"/>',
        f'<polyline class="flown" points="{line}"/>',
        f'<circle class="start" cx="{x0:.1f}" cy="{y0:.1f}" r="5"><title>start</title></circle>',
        f'<circle class="end" cx="{x1:.1f}" cy="{y1:.1f}" r="5"><title>end</title></circle>',
        f'<line class="scale" x1="12" x2="{12 + scale:.1f}" y1="{size - 14}" y2="{size - 14}"/>',
        f'<text x="12" y="{size - 20}">{step:g} m</text><text x="12" y="22">north is up</text>',
    ]
    return _svg(size, size, parts)


def _svg(width: int, height: int, parts: Sequence[str]) -> str:
    return f'<svg viewBox="0 0 {width} {height}" role="img">{"".join(parts)}</svg>'


def _y_axis(low: float, high: float, y_low: float, y_high: float, unit: str) -> str:
    parts = []
    for number in range(_TICKS + 1):
        share = number / _TICKS
        y = y_low + share * (y_high - y_low)
        label = f"{low + share * (high - low):.3g}" + (f" {unit}" if number == _TICKS else "")
        parts.append(
            f'<line class="grid" x1="{_LEFT}" x2="{_WIDTH - _RIGHT}" y1="{y:.1f}" y2="{y:.1f}"/>'
            f'<text x="{_LEFT - 6}" y="{y + 4:.1f}" text-anchor="end">{html.escape(label)}</text>'
        )
    return "".join(parts)


def _x_axis(line: TimeLine) -> str:
    step = _nice((line.to_s - line.from_s) / 8)
    first = math.ceil(line.from_s / step)
    parts = []
    for number in range(first, math.floor(line.to_s / step) + 1):
        x = line.x(number * step)
        parts.append(
            f'<text x="{x:.1f}" y="{_HEIGHT - 6}" text-anchor="middle">{number * step:g} s</text>'
        )
    return "".join(parts)


def _state_line(line: TimeLine, top: float) -> str:
    parts = []
    ends = [*(change.t_s for change in line.states[1:]), line.to_s]
    for change, end_s in zip(line.states, ends, strict=True):
        if end_s < line.from_s or change.t_s > line.to_s:
            continue
        x0, x1 = line.x(max(change.t_s, line.from_s)), line.x(min(end_s, line.to_s))
        state, cause = html.escape(change.state), html.escape(f"{change.cause} {change.detail}")
        parts.append(
            f'<rect class="state {state}" x="{x0:.1f}" y="{top + 2:.1f}" '
            f'width="{max(x1 - x0, 1.0):.1f}" height="{_STATES - 4}">'
            f"<title>{change.t_s:.2f} s {state}: {cause.strip()}</title></rect>"
        )
        if x1 - x0 > _LABEL_PX:
            parts.append(f'<text class="label" x="{x0 + 4:.1f}" y="{top + 13:.1f}">{state}</text>')
    return "".join(parts)


def _runs(samples: Samples) -> list[Samples]:
    """Samples between those that interrupt."""
    runs: list[Samples] = [[]]
    for sample in samples:
        if math.isfinite(sample[1]):
            runs[-1].append(sample)
        elif runs[-1]:
            runs.append([])
    return [run for run in runs if run]


def _thinned(points: Sequence[tuple[float, float]]) -> Sequence[tuple[float, float]]:
    """No more points than can be seen, the last one among them."""
    stride = math.ceil(len(points) / _MOST_POINTS)
    return points if stride <= 1 else [*points[::stride], points[-1]]


def _range(low: float, high: float) -> tuple[float, float]:
    step = _nice(max(high - low, 1e-3) / _TICKS)
    first = math.floor(low / step)
    while (first + _TICKS) * step < high:
        step = _nice(step * 1.2)
        first = math.floor(low / step)
    return first * step, (first + _TICKS) * step


def _nice(value: float) -> float:
    """Smallest of 1, 2, 2.5, 5 and 10 times a power of ten that is no less."""
    power = 10.0 ** math.floor(math.log10(value))
    return next(power * m for m in (1.0, 2.0, 2.5, 5.0, 10.0) if power * m >= value * (1 - 1e-9))
