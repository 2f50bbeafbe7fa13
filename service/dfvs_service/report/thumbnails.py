"""Thumbnails of a flight's views."""

import math
from collections.abc import Callable, Iterable

import numpy as np

from dfvs_service.report.flight import Flight, FlightView

_STRIP_VIEWS = 6


def collect(
    flight: Flight, views: Iterable[FlightView], on_view: Callable[[FlightView], None]
) -> list[FlightView]:
    """Go through the views up to the end of what a report shows, and pick some.

    Parameters
    ----------
    flight : Flight
    views : iterable of FlightView
        Oldest first.
    on_view : callable
        Is given every view.

    Returns
    -------
    list of FlightView
        Views at even steps of the way that was left; the last one is the last before the vehicle
        was handed back.
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
