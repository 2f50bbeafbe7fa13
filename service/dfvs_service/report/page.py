"""The page about a flight."""

from __future__ import annotations

import base64
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import cv2
from jinja2 import Environment, PackageLoader, select_autoescape

from dfvs_service.flights import layout
from dfvs_service.flights.records import FlightSummary, read_lines, read_summary
from dfvs_service.report.charts import Curve, TimeLine, path_chart, time_chart
from dfvs_service.report.series import FlightSeries, Samples, last_timing, read_series

_LEAD_S = 3.0
"""The charts begin so long before the vehicle was engaged."""
_VIEW_WIDTH = 480
_ENGAGED = "ENGAGE"


def flight_page(folder: Path) -> str:
    """HTML of the flight in a folder, with all images in it; what was not recorded is left out."""
    flight = read_summary(folder)
    header = next(read_lines(folder / layout.HEADER), {})
    start_ns = header.get("started_ns")
    series = read_series(folder, start_ns) if isinstance(start_ns, int) else FlightSeries()
    environment = Environment(
        loader=PackageLoader("dfvs_service.report", ""),
        autoescape=select_autoescape(default=True),
        trim_blocks=True,
    )
    return environment.get_template("flight.html.j2").render(
        flight=flight,
        tone=_tone(flight),
        views=_views(folder),
        path=path_chart(series.path),
        charts=_charts(series, _time_line(flight)),
        timing=_timing(last_timing(folder)),
        settings=_text(folder / layout.SETTINGS),
        build=_text(folder / layout.BUILD),
    )


def _tone(flight: FlightSummary) -> str:
    if flight.exit_code == 0:
        return "good"
    return "" if flight.status == "running" else "bad"


def _time_line(flight: FlightSummary) -> TimeLine:
    """The flight from shortly before it was engaged, or all of it where it was not."""
    engaged = [change.t_s for change in flight.states if change.state == _ENGAGED]
    from_s = max(engaged[0] - _LEAD_S, 0.0) if engaged else 0.0
    return TimeLine(from_s, max(flight.duration_s, from_s + 1.0), flight.states)


@dataclass(frozen=True, slots=True)
class _Chart:
    """A chart with the CSS classes and names of its curves; no SVG where nothing was recorded."""

    title: str
    legend: tuple[tuple[str, str], ...]
    svg: str


def _charts(series: FlightSeries, line: TimeLine) -> list[_Chart]:
    pairs = (("commanded", "commanded"), ("flown", "flown"))
    charts: list[_Chart] = []

    def add(title: str, unit: str, keys: tuple[tuple[str, str], ...], *samples: Samples) -> None:
        curves = [Curve(style, each) for (style, _), each in zip(keys, samples, strict=True)]
        svg = time_chart(curves, line, unit)
        charts.append(_Chart(title, keys, svg))

    add("Distance to the goal", "m", (("flown", "estimated from the image"),), series.error_m)
    add("Angle to the goal", "°", (("flown", "estimated from the image"),), series.error_deg)
    for number, axis in enumerate(("forward", "right", "down")):
        told, flown = series.commanded[number], series.flown[number]
        add(f"Velocity {axis}", "m/s", pairs, told, flown)
    keys = (("flown", "distance from the first position"), ("third", "height above it"))
    add("Position by the autopilot's estimate", "m", keys, series.from_start_m, series.height_m)
    add("Share of the view that shows the goal", "", (("third", "overlap"),), series.overlap)
    add("Capture to command", "ms", (("third", "latency of every frame"),), series.latency_ms)
    return charts


def _timing(stages: dict[str, Any]) -> list[tuple[str, str, str]]:
    rows = []
    for name, values in stages.items():
        if isinstance(values, dict):
            p50, p99 = (f"{float(values.get(key, 0.0)):.1f}" for key in ("p50_ms", "p99_ms"))
            rows.append((name, p50, p99))
    return rows


def _views(folder: Path) -> list[tuple[str, str]]:
    """Goal and last view, as far as they are there."""
    last = max((folder / layout.THUMBNAILS).glob("*.jpg"), key=_time_of, default=None)
    views = [("Goal", folder / "goal.png"), ("Last view", last)]
    return [(title, source) for title, path in views if path and (source := _image(path))]


def _time_of(path: Path) -> int:
    return int(path.stem) if path.stem.isdecimal() else 0


def _image(path: Path) -> str:
    """An image as a data URL, empty where it cannot be read."""
    image = cv2.imread(str(path), cv2.IMREAD_COLOR)
    if image is None:
        return ""
    height, width = image.shape[:2]
    if width > _VIEW_WIDTH:
        size = (_VIEW_WIDTH, max(round(height * _VIEW_WIDTH / width), 1))
        image = cv2.resize(image, size, interpolation=cv2.INTER_AREA)
    _, data = cv2.imencode(".jpg", image)
    return "data:image/jpeg;base64," + base64.b64encode(data.tobytes()).decode()


def _text(path: Path) -> str:
    try:
        return path.read_text(encoding="utf-8", errors="replace").strip()
    except OSError:
        return "not recorded"
