"""HTML page of a flight."""

import base64
import math
from collections.abc import Callable, Sequence
from pathlib import Path

import cv2
import numpy as np

from dfvs_core.geometry.arrays import ImageArray
from dfvs_service.page.charts import Curve, Plot, Samples, path_chart
from dfvs_service.page.page import Page, Table, Video, View, render
from dfvs_service.report.flight import BLACK_BOX, ENGAGED, Flight, FlightSource, FlightView, collect
from dfvs_service.report.series import Fault, FlightSeries, values_in
from dfvs_service.report.video import VideoWriter

MAX_EMBEDDED_BYTES = 24_000_000
"""A larger video stays a file beside the page."""

_TROUBLE = frozenset({"HOLD", "ABORT"})
_AXES = ("forward", "right", "down")


def make_report(
    source: FlightSource,
    flight: Flight,
    video_path: Path,
    show: Callable[[FlightView], None] = lambda _: None,
) -> str:
    """HTML of a flight with all images in it; its video is written beside it.

    ``video_path`` takes the film (VP8 in WebM), replaced once it is whole; a flight without a view
    has none. ``show`` is given every view once it is in the video.

    Raises
    ------
    DfvsError
        If the video cannot be written or the views cannot be read.
    """
    video = VideoWriter(video_path, flight, source.video_rate_hz)

    def on_view(view: FlightView) -> None:
        video.add(view)
        show(view)

    try:
        strip = collect(flight, source.views(), on_view)
        has_video = video.close()
    finally:
        video.abandon()
    return render(_page(flight, strip, video_path if has_video else None, source.note))


def _page(flight: Flight, strip: Sequence[FlightView], video: Path | None, note: str) -> Page:
    return Page(
        title=flight.summary.name,
        verdict=flight.summary.verdict,
        tone=_tone(flight),
        facts=_facts(flight),
        figures=_figures(flight),
        charts=_charts(flight),
        line=flight.line,
        views=_views(flight, strip),
        strip=tuple(View(_caption(flight, view), view.image) for view in strip),
        path=path_chart([(n, e) for t_s, n, e in flight.series.path if flight.line.shows(t_s)]),
        tables=(
            _states(flight),
            _faults(flight),
            Table("Errors and warnings", ("text",), tuple((t,) for t in flight.summary.told)),
            _timing(flight),
        ),
        texts=(
            ("Settings, angles in rad", flight.settings),
            ("Versions of code, libraries and model", flight.build),
        ),
        video=None if video is None else _embedded(video, flight.line.from_s),
        note=note if strip else "",
    )


def _embedded(path: Path, from_s: float) -> Video:
    source = path.name
    if path.stat().st_size <= MAX_EMBEDDED_BYTES:
        source = "data:video/webm;base64," + base64.b64encode(path.read_bytes()).decode()
    return Video(source, path.name, from_s)


def _tone(flight: Flight) -> str:
    if flight.summary.exit_code == 0:
        return "good"
    return "" if flight.summary.status == "running" else "bad"


def _facts(flight: Flight) -> tuple[tuple[str, str], ...]:
    summary = flight.summary
    end = f"in {flight.state_at(math.inf) or 'no state'}"
    if flight.source == BLACK_BOX:
        code = "" if summary.exit_code is None else f", exit code {summary.exit_code}"
        end = f"{summary.status} {end}{code}"
    return (
        ("Vehicle", summary.vehicle or "?"),
        ("Start", summary.started.replace("T", " ").replace("+00:00", " UTC") or "?"),
        ("Duration", f"{summary.duration_s:.1f} s"),
        ("End", end),
        ("Source", f"{flight.source}, {summary.size_bytes / 1e6:.1f} MB"),
        ("Version", f"dfvs {summary.version or '?'}"),
    )


def _figures(flight: Flight) -> tuple[tuple[str, str], ...]:
    """Numbers of the time in which the vehicle was engaged, as far as they are known."""
    series, spans = flight.series, flight.engagements
    which = f", engagement {flight.shown or len(spans)} of {len(spans)}" if len(spans) > 1 else ""
    figures = [("time under control", f"{sum(to_s - from_s for from_s, to_s in spans):.1f} s")]
    if not any(change.state in ENGAGED for change in flight.summary.states):
        figures = [("time under control", "none")]
    for name, samples, form, unit in (
        ("distance to the goal, estimated", series.error_m, ".3f", "m"),
        ("angle to the goal, estimated", series.error_deg, ".1f", "°"),
        ("distance to the goal, true", series.true_m, ".3f", "m"),
        ("angle to the goal, true", series.true_deg, ".1f", "°"),
    ):
        known = values_in(samples, [flight.flown])
        if known:
            figures.append((name + which, f"{known[0]:{form}} → {known[-1]:{form}} {unit}"))
    if latency := values_in(series.latency_ms, spans):
        p50, p99 = np.percentile(latency, [50, 99])
        figures.append(("capture to command, median and p99", f"{p50:.0f} / {p99:.0f} ms"))
    return tuple(figures)


def _charts(flight: Flight) -> tuple[tuple[str, Plot], ...]:
    series, limits = flight.series, flight.limits
    in_m = None if limits is None else limits.tolerance_m
    in_deg = None if limits is None else math.degrees(limits.tolerance_rad)
    pairs = [
        (f"Velocity {axis}", Plot("m/s", _commanded_and_flown(series, number)))
        for number, axis in enumerate(_AXES)
    ]
    in_degrees = [
        Curve(c.style, c.name, [(t, math.degrees(v)) for t, v in c.samples])
        for c in _commanded_and_flown(series, 3)
    ]
    position = (
        Curve("flown", "distance from the first position", series.from_start_m),
        Curve("third", "height above it", series.height_m),
    )
    overlap = Curve("third", "overlap", series.overlap)
    latency = Curve("third", "every frame", series.latency_ms)
    return (
        (
            "Distance to the goal",
            Plot("m", _errors(series.error_m, series.true_m), series.spread_m, in_m),
        ),
        (
            "Angle to the goal",
            Plot("°", _errors(series.error_deg, series.true_deg), tolerance=in_deg),
        ),
        *pairs,
        ("Yaw rate", Plot("°/s", tuple(in_degrees))),
        ("Position by the autopilot's estimate", Plot("m", position)),
        ("Share of the view that shows the goal", Plot("", (overlap,))),
        ("Capture to command", Plot("ms", (latency,), is_log=True)),
    )


def _errors(estimated: Samples, true: Samples) -> tuple[Curve, ...]:
    curves = (Curve("flown", "estimated from the images", estimated),)
    return (*curves, Curve("third", "true, of the simulation", true)) if true else curves


def _commanded_and_flown(series: FlightSeries, number: int) -> tuple[Curve, ...]:
    return (
        Curve("commanded", "commanded", series.commanded[number]),
        Curve("flown", "flown", series.flown[number]),
    )


def _views(flight: Flight, strip: Sequence[FlightView]) -> tuple[View, ...]:
    """Goal, last view, and what is left between them."""
    goal = flight.goal_at(flight.flown[1])
    views = [] if goal is None else [View("Goal", goal)]
    if strip:
        last = strip[-1]
        views.append(View(f"Last view under control, {_caption(flight, last)}", last.image))
        if goal is not None:
            views.append(View("Last view − goal: grey is equal", _difference(last.image, goal)))
    return tuple(views)


def _difference(view: ImageArray, goal: ImageArray) -> ImageArray:
    """Signed difference around middle grey, as in the paper's Fig. 4, at the view's size."""
    fitting = cv2.resize(goal, view.shape[1::-1], interpolation=cv2.INTER_AREA)
    signed = (view.astype(np.int16) - fitting.astype(np.int16)) // 2 + 128
    return np.clip(signed, 0, 255).astype(np.uint8)


def _caption(flight: Flight, view: FlightView) -> str:
    """Time of a view, and what was left then."""
    caption = f"{view.t_s:.1f} s"
    known = [
        next((v for t, v in reversed(samples) if t <= view.t_s + 0.2 and math.isfinite(v)), None)
        for samples in (flight.series.error_m, flight.series.error_deg)
    ]
    if known[0] is not None and known[1] is not None:
        caption += f": {known[0]:.2f} m, {known[1]:.1f}°"
    return caption


def _states(flight: Flight) -> Table:
    rows = tuple((f"{c.t_s:.2f}", c.state, c.reason) for c in flight.summary.states)
    return Table("States", ("s", "state", "cause"), rows, ("s",))


def _faults(flight: Flight) -> Table:
    """What made the gate leave the goal, and why frames were not flown by."""
    left = [
        Fault(c.t_s, c.t_s, f"{c.state}: {c.cause} {c.detail}".strip())
        for c in flight.summary.states
        if c.state in _TROUBLE
    ]
    from_s, to_s = flight.line.from_s, flight.line.to_s
    faults = (*left, *flight.series.faults)
    shown = [f for f in faults if f.from_s <= to_s and f.to_s >= from_s]
    rows = tuple(
        (f"{f.from_s:.2f}", f"{f.to_s - f.from_s:.2f}", str(f.count), f.text)
        for f in sorted(shown, key=lambda fault: fault.from_s)
    )
    head = ("s", "for, s", "times", "fault")
    return Table("Faults", head, rows, head[:3], "None in the time of the plots.")


def _timing(flight: Flight) -> Table:
    rows = tuple(
        (name.replace("_", " "), f"{p50:.1f}", f"{p99:.1f}")
        for name, (p50, p99) in flight.series.stage_percentiles(flight.engagements).items()
    )
    head = ("stage", "p50, ms", "p99, ms")
    return Table("Time of each stage", head, rows, head[1:], "Nothing was recorded.")
