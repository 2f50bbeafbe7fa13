"""Flight as a report needs it, independent of its source."""

import json
import math
from collections.abc import Callable, Iterable, Iterator
from dataclasses import dataclass
from typing import Protocol

import numpy as np

from dfvs_core.geometry.arrays import ImageArray
from dfvs_core.matching.correspondence import FlowField
from dfvs_service.flights.records import FlightSummary
from dfvs_service.page.charts import TimeLine
from dfvs_service.report.series import FlightSeries, Span

BLACK_BOX, RECORDING = "black box", "recording"
"""Sources of a flight."""

_LEAD_S = 3.0
"""A report shows so long before the vehicle was engaged, and after it was handed back."""
_NEVER_ENGAGED_S = 60.0
ENGAGED = frozenset({"ENGAGE", "SERVO", "HOLD", "DONE"})
_STRIP_VIEWS = 6


@dataclass(frozen=True, slots=True)
class FlightView:
    """What the camera saw at a time: an image (H, W, 3) RGB, and the flow on it where it is known.

    ``flow`` leads from the image to the goal, in px of the image.
    """

    t_s: float
    image: ImageArray
    flow: FlowField | None = None


@dataclass(frozen=True, slots=True)
class ServoLimits:
    """Distance in m and angle in rad that count as reached, and confidence of flow that counts."""

    tolerance_m: float
    tolerance_rad: float
    min_confidence: float


@dataclass(frozen=True, slots=True)
class Flight:
    """A flight with its curves; times in s from ``start_ns`` (monotonic).

    ``settings`` and ``build`` are JSON; ``goals`` are the images (H, W, 3) RGB that were flown to,
    each with its time. ``run_ends_s`` holds when runs of the service ended that another followed.
    ``shown`` is the engagement that a report shows, from 1; 0 for the last.
    """

    summary: FlightSummary
    source: str
    start_ns: int
    series: FlightSeries
    settings: str
    build: str
    goals: tuple[tuple[float, ImageArray], ...]
    run_ends_s: tuple[float, ...] = ()
    shown: int = 0

    @property
    def engagements(self) -> tuple[Span, ...]:
        """From when to when the vehicle was engaged, each time; the last minute where never."""
        end_s, spans, since_s = self.summary.duration_s, [], None
        changes = [(change.t_s, change.state in ENGAGED) for change in self.summary.states]
        changes += [(t_s, False) for t_s in self.run_ends_s]
        for t_s, is_engaged in (*sorted(changes, key=lambda change: change[0]), (end_s, False)):
            if is_engaged and since_s is None:
                since_s = t_s
            elif not is_engaged and since_s is not None:
                spans.append((since_s, t_s))
                since_s = None
        return tuple(spans) or ((max(end_s - _NEVER_ENGAGED_S, 0.0), end_s),)

    @property
    def flown(self) -> Span:
        """From when to when the vehicle was engaged, in the engagement that is shown."""
        return self.engagements[self.shown - 1]

    @property
    def line(self) -> TimeLine:
        """The time that the report shows."""
        from_s, to_s = self.flown
        from_s = max(from_s - _LEAD_S, 0.0)
        to_s = min(to_s + _LEAD_S, self.summary.duration_s)
        return TimeLine(from_s, max(to_s, from_s + 1.0), self.summary.states)

    @property
    def limits(self) -> ServoLimits | None:
        """Of the settings, None where they are not known."""
        try:
            servo = json.loads(self.settings)["servo"]
            names = ("tolerance_m", "tolerance_rad", "min_confidence")
            return ServoLimits(*(float(servo[name]) for name in names))
        except (ValueError, KeyError, TypeError):
            return None

    def goal_at(self, t_s: float) -> ImageArray | None:
        """Goal that was flown to at a time."""
        known = [image for since_s, image in self.goals if since_s <= t_s]
        known = known or [image for _, image in self.goals[:1]]
        return known[-1] if known else None

    def state_at(self, t_s: float) -> str:
        """State of the gate at a time; empty before the first one."""
        states = reversed(self.summary.states)
        return next((change.state for change in states if change.t_s <= t_s), "")


class FlightSource(Protocol):
    """Records of a flight."""

    name: str
    """Name of the flight, fit for a file."""
    video_rate_hz: int
    """Frames a second that do the views justice."""
    note: str
    """What a reader has to know of the views that were given; empty for nothing."""

    def read(self) -> Flight:
        """All but the views."""

    def views(self) -> Iterator[FlightView]:
        """What the camera saw, oldest first."""


def collect(
    flight: Flight, views: Iterable[FlightView], on_view: Callable[[FlightView], None]
) -> list[FlightView]:
    """Go through the views up to the end of what a report shows, and pick some.

    ``views`` come oldest first, and ``on_view`` is given every one. Those picked are at even steps
    of the way that was left; the last one is the last before the vehicle was handed back.
    """
    strip: list[FlightView] = []
    line, (from_s, to_s) = flight.line, flight.flown
    wanted = _strip_times(flight)
    last: FlightView | None = None
    for view in views:
        if view.t_s > line.to_s:
            break
        on_view(view)
        if view.t_s > to_s:
            continue
        last = view
        if wanted and view.t_s >= max(wanted[0], from_s):
            strip.append(view)
            wanted = [t_s for t_s in wanted if t_s > view.t_s]
    if last is not None and (not strip or strip[-1] is not last):
        strip = [*strip[: _STRIP_VIEWS - 1], last]
    return strip


def _strip_times(flight: Flight) -> list[float]:
    """When an even share of the distance was left; even times where it is not known."""
    from_s, to_s = flight.flown
    samples = [(t, v) for t, v in flight.series.error_m if from_s <= t <= to_s and math.isfinite(v)]
    if len(samples) < _STRIP_VIEWS:
        return [float(t) for t in np.linspace(from_s, to_s, _STRIP_VIEWS)]
    least = np.minimum.accumulate([v for _, v in samples])
    targets = np.linspace(least[0], least[-1], _STRIP_VIEWS)
    return [samples[int(np.argmax(least <= target + 1e-9))][0] for target in targets]
