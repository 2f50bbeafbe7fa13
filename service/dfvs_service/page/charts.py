"""SVG charts: curves over time above a line of the gate's states, and a path from above."""

import html
import itertools
import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass, field
from typing import TypeVar

from dfvs_service.flights.records import StateChange
from dfvs_service.page.axes import Axis, linear_axis, log_axis, nice_step, tolerance_axis

Samples = list[tuple[float, float]]
"""Time in s from the start of the flight, and value; NaN interrupts a curve."""
Interval = tuple[float, float, float]
"""Time in s, lower and upper value."""

T = TypeVar("T")
Sample = TypeVar("Sample", tuple[float, float], Interval)

_WIDTH, _HEIGHT = 520, 220
_LEFT, _RIGHT, _TOP, _STATES, _BOTTOM = 56, 10, 10, 20, 22
_MOST_POINTS = 1500
_PATH_WIDTH, _PATH_HEIGHT = 420, 315
_LETTER_PX = 7.5
"""A state that is shown narrower than its name has no label, only a tooltip."""


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
    """Samples with the CSS class that they are drawn in and the name that the legend gives."""

    style: str
    name: str
    samples: Samples


@dataclass(frozen=True, slots=True)
class Plot:
    """What a chart shows.

    ``band`` holds times with a lower and an upper value, drawn behind the curves. Values below
    ``tolerance`` count as reached: the scale is logarithmic, and this part of it is marked.
    ``is_log``: all values are positive, and the scale is logarithmic.
    """

    unit: str
    curves: tuple[Curve, ...]
    band: list[Interval] = field(default_factory=list)
    tolerance: float | None = None
    is_log: bool = False


def time_chart(plot: Plot, line: TimeLine) -> str:
    """SVG of curves over time; empty where there is nothing to show."""
    shown = [[s for s in c.samples if line.shows(s[0])] for c in plot.curves]
    values = [v for samples in shown for _, v in samples if math.isfinite(v)]
    if not values:
        return ""
    bottom = _HEIGHT - _BOTTOM - _STATES
    axis = _axis(plot, values)

    def y(value: float) -> float:
        return bottom - axis.share(value) * (bottom - _TOP)

    parts = []
    if plot.tolerance is not None:
        top = y(plot.tolerance)
        parts.append(
            f'<rect class="reached" x="{_LEFT}" y="{top:.1f}" width="{_WIDTH - _LEFT - _RIGHT}" '
            f'height="{max(bottom - top, 0):.1f}"/>'
        )
    parts += [_y_axis(axis, bottom), _x_axis(line), _state_line(line, bottom)]
    parts += [
        f'<polygon class="band" points="{_around(run, line, y)}"/>'
        for run in _runs([interval for interval in plot.band if line.shows(interval[0])])
    ]
    for curve, samples in zip(plot.curves, shown, strict=True):
        for run in _runs(samples):
            points = " ".join(f"{line.x(t):.1f},{y(v):.1f}" for t, v in _thinned(run))
            parts.append(f'<polyline class="{curve.style}" points="{points}"/>')
    return _svg(_WIDTH, _HEIGHT, parts, _readings(axis, line, bottom))


def _axis(plot: Plot, values: Sequence[float]) -> Axis:
    if plot.tolerance is not None:
        return tolerance_axis(values, plot.tolerance)
    if plot.is_log:
        return log_axis(min(values), max(values))
    return linear_axis(min(*values, 0.0), max(*values, 0.0))


def path_chart(path: Sequence[tuple[float, float]]) -> str:
    """SVG of (north, east) in m seen from above, north up, with one scale; empty without points."""
    points = [(n, e) for n, e in path if math.isfinite(n) and math.isfinite(e)]
    if not points:
        return ""
    norths, easts = zip(*points, strict=True)
    width, height = _PATH_WIDTH, _PATH_HEIGHT
    wide = max(max(easts) - min(easts), (max(norths) - min(norths)) * width / height, 0.5) * 1.3
    centre = (max(norths) + min(norths)) / 2, (max(easts) + min(easts)) / 2
    px_per_m = width / wide

    def place(point: tuple[float, float]) -> tuple[float, float]:
        return (
            0.5 * width + px_per_m * (point[1] - centre[1]),
            0.5 * height - px_per_m * (point[0] - centre[0]),
        )

    step = nice_step(wide / 5)
    places = [place(p) for p in _thinned(points)]
    line = " ".join(f"{x:.1f},{y:.1f}" for x, y in places)
    (x0, y0), (x1, y1) = place(points[0]), place(points[-1])
    low = height - 16
    parts = [
        f'<rect class="frame" x="0" y="0" width="{width}" height="{height}"/>',
        f'<polyline class="flown" points="{line}"/>',
        f'<circle class="start" cx="{x0:.1f}" cy="{y0:.1f}" r="6"/>',
        f'<circle class="end" cx="{x1:.1f}" cy="{y1:.1f}" r="6"/>',
        f'<text x="{x0 + 10:.1f}" y="{y0 + 5:.1f}">start</text>',
        f'<text x="{x1 + 10:.1f}" y="{y1 + 5:.1f}">end</text>',
        f'<line class="scale" x1="14" x2="{14 + px_per_m * step:.1f}" y1="{low}" y2="{low}"/>',
        f'<text x="14" y="{low - 8}">{step:g} m</text><text x="14" y="26">north is up</text>',
    ]
    return _svg(width, height, parts)


def _svg(width: int, height: int, parts: Sequence[str], attributes: str = "") -> str:
    head = f'<svg viewBox="0 0 {width} {height}" role="img"{attributes}>'
    return f"{head}{''.join(parts)}</svg>"


def _readings(axis: Axis, line: TimeLine, bottom: float) -> str:
    """Attributes by which a place in the chart is read as a time and a value."""
    readings = {
        "from": line.from_s,
        "to": line.to_s,
        "left": _LEFT,
        "right": _WIDTH - _RIGHT,
        "low": axis.low,
        "high": axis.high,
        "bottom": bottom,
        "top": _TOP,
        "log": int(axis.is_log),
    }
    return "".join(f' data-{name}="{value:g}"' for name, value in readings.items())


def _y_axis(axis: Axis, bottom: float) -> str:
    parts = []
    for tick in axis.ticks:
        y = bottom - axis.share(tick) * (bottom - _TOP)
        parts.append(
            f'<line class="grid" x1="{_LEFT}" x2="{_WIDTH - _RIGHT}" y1="{y:.1f}" y2="{y:.1f}"/>'
            f'<text x="{_LEFT - 6}" y="{y + 4:.1f}" text-anchor="end">{tick:.4g}</text>'
        )
    return "".join(parts)


def _x_axis(line: TimeLine) -> str:
    step = nice_step((line.to_s - line.from_s) / 6)
    first = math.ceil(line.from_s / step)
    parts = []
    for number in range(first, math.floor(line.to_s / step) + 1):
        x = min(line.x(number * step), _WIDTH - 2.0 * _RIGHT)
        parts.append(
            f'<text x="{x:.1f}" y="{_HEIGHT - 6}" text-anchor="middle">{number * step:g} s</text>'
        )
    return "".join(parts)


def _state_line(line: TimeLine, top: float) -> str:
    parts = []
    ends = [*(change.t_s for change in line.states[1:]), line.to_s]
    for change, end_s in zip(line.states, ends, strict=False):  # there may be no state
        if end_s < line.from_s or change.t_s > line.to_s:
            continue
        x0, x1 = line.x(max(change.t_s, line.from_s)), line.x(min(end_s, line.to_s))
        state, cause = html.escape(change.state), html.escape(f"{change.cause} {change.detail}")
        parts.append(
            f'<rect class="state {state}" x="{x0:.1f}" y="{top + 3:.1f}" '
            f'width="{max(x1 - x0, 1.0):.1f}" height="{_STATES - 4}">'
            f"<title>{change.t_s:.2f} s {state}: {cause.strip()}</title></rect>"
        )
        if x1 - x0 > _LETTER_PX * len(state) + 4:
            parts.append(f'<text class="label" x="{x0 + 4:.1f}" y="{top + 15:.1f}">{state}</text>')
    return "".join(parts)


def _runs(samples: Sequence[Sample]) -> list[list[Sample]]:
    """Samples, or intervals, between those that interrupt."""
    groups = itertools.groupby(samples, lambda sample: all(map(math.isfinite, sample)))
    return [list(run) for is_known, run in groups if is_known]


def _around(run: Sequence[Interval], line: TimeLine, y: Callable[[float], float]) -> str:
    thin = _thinned(run)
    corners = [(t, high) for t, _, high in thin] + [(t, low) for t, low, _ in reversed(thin)]
    return " ".join(f"{line.x(t):.1f},{y(v):.1f}" for t, v in corners)


def _thinned(points: Sequence[T]) -> Sequence[T]:
    """No more points than can be seen, the last one among them."""
    stride = math.ceil(len(points) / _MOST_POINTS)
    return points if stride <= 1 else [*points[::stride], points[-1]]
