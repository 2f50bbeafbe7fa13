"""The flights in the report's page."""

from __future__ import annotations

import math
from collections.abc import Iterable, Sequence

from dfvs_bench.drone.records import FlightRecord
from dfvs_bench.drone.tables import summarise, summary_line
from dfvs_bench.report.page import table

_HEAD = (
    "task",
    "start",
    "overlap",
    "bound",
    "first motion",
    "within 5 cm, 1°",
    "÷ bound",
    "done",
    "÷ bound",
    "translation",
    "rotation",
    "path ÷ line",
    "end",
)
_TEXT = """<p>The tasks flown in real time by the simulated vehicle through the real service, with
four degrees of freedom: start and goal levelled, the goal image taken anew. The bound is the
least time that the straight line takes at {horizontal:g} m/s over ground, {vertical:g} m/s
vertically, {yaw:.0f}°/s, and changes of at most {slew:g} m/s² and {yaw_slew:.0f}°/s², by a vehicle
that follows at once. Times count from the pilot's switch; errors are by the truth. The paper has no
such table: its one flight is judged by eye. State estimate of the vehicle: {estimate}; wind:
{wind}.</p><p>{summary}.</p>"""


def drone_section(records: Sequence[FlightRecord]) -> str:
    """HTML of the section, with its heading."""
    limits = records[0].limits
    text = _TEXT.format(
        horizontal=limits.horizontal_m_s,
        vertical=limits.vertical_m_s,
        yaw=math.degrees(limits.yaw_rad_s),
        slew=limits.slew_m_s2,
        yaw_slew=math.degrees(limits.yaw_slew_rad_s2),
        estimate=_all_of(record.estimate for record in records),
        wind=_all_of(record.wind for record in records),
        summary=summary_line(summarise(records)),
    )
    return f"<h2>Flights</h2>{text}{table(_HEAD, [_row(record) for record in records])}"


def _all_of(names: Iterable[str]) -> str:
    return ", ".join(sorted(set(names)))


def _row(record: FlightRecord) -> tuple[str, ...]:
    return (
        record.task,
        f"{record.initial_translation_m:.2f} m {record.initial_rotation_deg:.1f}°",
        f"{record.overlap:.0%}",
        f"{record.bound.least_s:.1f} s",
        _number(record.servo_s, "{:.1f} s"),
        _number(record.within_s, "{:.1f} s"),
        _number(record.within_ratio, "{:.2f}"),
        _number(record.done_s, "{:.1f} s"),
        _number(record.done_ratio, "{:.2f}"),
        _number(record.final_translation_m, "{:.3f} m"),
        _number(record.final_rotation_deg, "{:.2f}°"),
        _number(record.path_ratio, "{:.2f}"),
        "converged" if record.converged else f"{record.end_state}: {record.end_cause}",
    )


def _number(value: float | None, form: str) -> str:
    return "–" if value is None else form.format(value)
