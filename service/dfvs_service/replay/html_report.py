"""A comparison as one HTML page that needs nothing else: numbers, and curves over time."""

from __future__ import annotations

import html
import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass

from dfvs_core.wire.link import PerceptionReport
from dfvs_service.replay.comparison import Comparison, FrameDifference

_WIDTH, _HEIGHT = 860, 200
_LEFT, _RIGHT, _TOP, _BOTTOM = 64, 24, 12, 26
_TICKS = 4

_STYLE = """
body { font: 15px/1.5 system-ui, sans-serif; margin: 2rem auto; max-width: 900px; padding: 0 1rem;
  color: #1b1f24; background: #fff }
h1 { font-size: 1.4rem } h2 { font-size: 1.05rem; margin: 1.6rem 0 .3rem }
pre { background: #f4f5f7; padding: .8rem 1rem; overflow-x: auto; border-radius: 6px }
svg { width: 100%; height: auto } text { font: 11px system-ui, sans-serif; fill: #57606a }
.grid { stroke: #d8dee4 } .recorded { stroke: #8250df } .replayed { stroke: #1a7f37 }
.difference { stroke: #cf222e } polyline { fill: none; stroke-width: 1.4 }
.key { display: inline-block; width: 1.4em; height: .25em; vertical-align: middle;
  margin: 0 .4em 0 1em }
"""

Value = Callable[[FrameDifference], float | None]


@dataclass(frozen=True, slots=True)
class _Curve:
    style: str
    value: Value


@dataclass(frozen=True, slots=True)
class _Chart:
    title: str
    curves: tuple[_Curve, ...]


def html_report(comparison: Comparison, text: str, title: str) -> str:
    """Page about a comparison; ``text`` is the same in words."""
    charts = "\n".join(_chart(chart, comparison.frames) for chart in _CHARTS)
    name = html.escape(title)
    return f"""<!doctype html>
<html lang="en"><meta charset="utf-8"><title>Replay of {name}</title><style>{_STYLE}</style>
<h1>Replay of {name}</h1>
<pre>{html.escape(text)}</pre>
<p><span class="key" style="background:#8250df"></span>recorded
<span class="key" style="background:#1a7f37"></span>replayed
<span class="key" style="background:#cf222e"></span>difference; gaps: not flown by</p>
{charts}
</html>
"""


def _both(of: Callable[[PerceptionReport], float]) -> tuple[_Curve, ...]:
    """Curves of a quantity in flight and in replay, where it would have been flown by."""

    def then(frame: FrameDifference) -> float | None:
        return of(frame.recorded) if frame.recorded.healthy else None

    def now(frame: FrameDifference) -> float | None:
        return of(frame.replayed) if frame.replayed.healthy else None

    return _Curve("recorded", then), _Curve("replayed", now)


def _degrees(value: float | None) -> float | None:
    return None if value is None else math.degrees(value)


_CHARTS = (
    _Chart("Forward, m/s", _both(lambda report: report.velocity[0])),
    _Chart("Right, m/s", _both(lambda report: report.velocity[1])),
    _Chart("Down, m/s", _both(lambda report: report.velocity[2])),
    _Chart("Yaw rate, °/s", _both(lambda report: math.degrees(report.velocity[3]))),
    _Chart(
        "Length of the velocities' difference, m/s",
        (_Curve("difference", lambda f: f.velocity_m_s),),
    ),
    _Chart("Error, m", _both(lambda report: report.error_m)),
    _Chart("Error, °", _both(lambda report: math.degrees(report.error_rad))),
    _Chart("Overlap", _both(lambda report: report.overlap)),
)


def _chart(chart: _Chart, frames: Sequence[FrameDifference]) -> str:
    curves = [(curve.style, [curve.value(frame) for frame in frames]) for curve in chart.curves]
    known = [value for _, values in curves for value in values if value is not None]
    heading = f"<h2>{html.escape(chart.title)}</h2>"
    if not known:
        return f"{heading}<p>nothing to show</p>"
    low, high = min(known), max(known)
    if high - low < 1e-9:
        low, high = low - 0.5, high + 0.5
    t0_ns, t1_ns = frames[0].t_ns, max(frames[-1].t_ns, frames[0].t_ns + 1)

    def x(t_ns: float) -> float:
        return _LEFT + (_WIDTH - _LEFT - _RIGHT) * (t_ns - t0_ns) / (t1_ns - t0_ns)

    def y(value: float) -> float:
        return _HEIGHT - _BOTTOM - (_HEIGHT - _TOP - _BOTTOM) * (value - low) / (high - low)

    lines = [
        f'<polyline class="{style}" points="{points}"/>'
        for style, values in curves
        for points in _pieces(frames, values, x, y)
    ]
    axes = _axes((low, high), (t1_ns - t0_ns) * 1e-9, y)
    return f'{heading}<svg viewBox="0 0 {_WIDTH} {_HEIGHT}">{axes}{"".join(lines)}</svg>'


def _pieces(
    frames: Sequence[FrameDifference],
    values: Sequence[float | None],
    x: Callable[[float], float],
    y: Callable[[float], float],
) -> list[str]:
    """Points of a curve, a piece for every run of known values."""
    pieces: list[list[str]] = [[]]
    for frame, value in zip(frames, values, strict=True):
        if value is None:
            pieces.append([])
        else:
            pieces[-1].append(f"{x(frame.t_ns):.1f},{y(value):.1f}")
    return [" ".join(piece) for piece in pieces if piece]


def _axes(values: tuple[float, float], duration_s: float, y: Callable[[float], float]) -> str:
    low, high = values
    parts = []
    for i in range(_TICKS + 1):
        value = low + (high - low) * i / _TICKS
        at = y(value)
        parts.append(
            f'<line class="grid" x1="{_LEFT}" x2="{_WIDTH - _RIGHT}" y1="{at:.1f}" y2="{at:.1f}"/>'
            f'<text x="{_LEFT - 6}" y="{at + 4:.1f}" text-anchor="end">{value:.3g}</text>'
        )
        t_s, across = duration_s * i / _TICKS, (_WIDTH - _LEFT - _RIGHT) * i / _TICKS
        parts.append(
            f'<text x="{_LEFT + across:.1f}" y="{_HEIGHT - 8}" text-anchor="middle">'
            f"{t_s:.1f} s</text>"
        )
    return "".join(parts)
