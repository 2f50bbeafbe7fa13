"""Text and HTML reports of a comparison."""

import math
from collections.abc import Callable, Sequence

from dfvs_core.messages.link import PerceptionReport
from dfvs_service.page.charts import Curve, Plot, TimeLine
from dfvs_service.page.page import Page, Table, render
from dfvs_service.replay.comparison import Comparison, FrameDifference, Spread
from dfvs_service.replay.flight import Replay

_Value = Callable[[FrameDifference], float | None]


def text_report(comparison: Comparison, reasons: Sequence[str]) -> str:
    """Some lines about a comparison.

    ``reasons`` say why the replay may differ; none where it must not.
    """
    total = len(comparison.frames)
    lines = [_verdict(comparison, reasons)]
    lines += [f"  other than in flight: {reason}" for reason in reasons]
    if not comparison.is_identical and total:
        lines += [
            f"frames             {total}, {comparison.identical} identical, first difference in "
            f"frame record {comparison.first_difference}",
            f"flown by           {comparison.healthy_recorded} recorded, "
            f"{comparison.healthy_replayed} replayed, {comparison.healthy_both} both",
            f"velocity           {_spread(comparison.velocity_m_s, 1.0, 'm/s')}",
            f"yaw rate           {_spread(comparison.yaw_rate_rad_s, math.degrees(1.0), '°/s')}",
            f"error, distance    {_spread(comparison.error_m, 1.0, 'm')}",
            f"error, angle       {_spread(comparison.error_rad, math.degrees(1.0), '°')}",
        ]
    lines += [
        f"{name.replace('_', ', '):<18} {value.p50_ms:.1f} ms median, {value.p99_ms:.1f} ms p99"
        for name, value in comparison.latency.items()
    ]
    return "\n".join(lines)


def _verdict(comparison: Comparison, reasons: Sequence[str]) -> str:
    """One sentence on whether the replay is the flight."""
    total = len(comparison.frames)
    if not total:
        return "no frames to replay"
    if comparison.is_identical:
        return f"identical: all {total} commands are the same, bit for bit"
    if reasons:
        return f"{total - comparison.identical} of {total} commands differ"
    return (
        f"NOT identical: {total - comparison.identical} of {total} commands differ although "
        "build, model and settings are the same"
    )


def _spread(spread: Spread | None, factor: float, unit: str) -> str:
    if spread is None:
        return "no frame was flown by in both"
    return (
        f"differs by {spread.p50 * factor:.4f} {unit} in the median, "
        f"{spread.p95 * factor:.4f} p95, {spread.greatest * factor:.4f} at most"
    )


def html_report(comparison: Comparison, replay: Replay, title: str) -> str:
    """Page about a comparison of a flight with its replay."""
    frames = comparison.frames
    end_s = max(replay.times_s, default=0.0)
    reasons = tuple((reason,) for reason in replay.reasons)
    times = tuple(
        (name.replace("_", ", "), f"{value.p50_ms:.1f}", f"{value.p99_ms:.1f}")
        for name, value in comparison.latency.items()
    )
    heads = ("time", "p50, ms", "p99, ms")
    return render(
        Page(
            title=f"Replay of {title}",
            verdict=_verdict(comparison, replay.reasons),
            tone=_tone(comparison, replay),
            facts=(),
            figures=_figures(comparison),
            charts=_charts(frames, replay.times_s),
            line=TimeLine(0.0, max(end_s, 1.0), replay.states),
            tables=(
                Table("Other than in flight", ("reason to differ",), reasons, (), "Nothing."),
                Table("Time taken", heads, times, heads[1:], "Nothing was recorded."),
            ),
            texts=(("The comparison in words", text_report(comparison, replay.reasons)),),
        )
    )


def _tone(comparison: Comparison, replay: Replay) -> str:
    if comparison.is_identical:
        return "good"
    return "" if replay.reasons else "bad"


def _figures(comparison: Comparison) -> tuple[tuple[str, str], ...]:
    total = len(comparison.frames)
    return (
        ("frames identical", f"{comparison.identical} of {total}"),
        ("flown by in flight", f"{comparison.healthy_recorded} of {total}"),
        ("flown by in replay", f"{comparison.healthy_replayed} of {total}"),
    )


def _charts(
    frames: Sequence[FrameDifference], times_s: Sequence[float]
) -> tuple[tuple[str, Plot], ...]:
    def curve(style: str, name: str, value: _Value) -> Curve:
        """Curve of a value, interrupted where it is not known."""
        values = zip(times_s, map(value, frames), strict=True)
        return Curve(style, name, [(t_s, math.nan if v is None else v) for t_s, v in values])

    def both(of: Callable[[PerceptionReport], float]) -> tuple[Curve, ...]:
        """Curves of a quantity in flight and in replay, where it would have been flown by."""
        return (
            curve(
                "commanded", "recorded", lambda f: of(f.recorded) if f.recorded.healthy else None
            ),
            curve("flown", "replayed", lambda f: of(f.replayed) if f.replayed.healthy else None),
        )

    difference = curve("third", "length of the difference", lambda f: f.velocity_m_s)
    return (
        ("Velocity forward", Plot("m/s", both(lambda report: report.velocity[0]))),
        ("Velocity right", Plot("m/s", both(lambda report: report.velocity[1]))),
        ("Velocity down", Plot("m/s", both(lambda report: report.velocity[2]))),
        ("Yaw rate", Plot("°/s", both(lambda report: math.degrees(report.velocity[3])))),
        ("Difference of the velocities", Plot("m/s", (difference,))),
        ("Distance to the goal", Plot("m", both(lambda report: report.error_m))),
        ("Angle to the goal", Plot("°", both(lambda report: math.degrees(report.error_rad)))),
        ("Share of the view that shows the goal", Plot("", both(lambda report: report.overlap))),
    )
