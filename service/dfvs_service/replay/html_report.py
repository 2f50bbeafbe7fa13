"""HTML report of a comparison."""

import math
from collections.abc import Callable, Sequence

from dfvs_core.messages.link import PerceptionReport
from dfvs_service.page.charts import Curve, Plot, TimeLine
from dfvs_service.page.page import Page, Table, render
from dfvs_service.replay.comparison import Comparison, FrameDifference
from dfvs_service.replay.flight import Replay
from dfvs_service.replay.text_report import text_report, verdict

_Value = Callable[[FrameDifference], float | None]


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
            verdict=verdict(comparison, replay.reasons),
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
