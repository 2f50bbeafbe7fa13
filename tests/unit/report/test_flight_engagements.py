"""Figures of a flight that was engaged more than once."""

import dataclasses
import re

import numpy as np
import pytest

from dfvs_service.flights.records import FlightSummary, StateChange
from dfvs_service.report.flight import BLACK_BOX, Flight
from dfvs_service.report.flight_page import make_report
from dfvs_service.report.series import FlightSeries

FLOWN = ((0, "READY"), (5, "ENGAGE"), (6, "SERVO"), (20, "DONE"), (25, "RELEASED"))


class Source:
    """Records of a flight, without a view."""

    name, video_rate_hz, note = "f", 10, ""

    def views(self):
        return iter(())


@pytest.fixture
def flight():
    """Two flights of 20 s, two hours apart; by hand, frames are late and far from the goal."""
    states = [StateChange(t_s + s, state, "", "") for t_s in (60.0, 7200.0) for s, state in FLOWN]
    summary = FlightSummary("f", "", "", "", 7400.0, "ended", 0, "", tuple(states), (), "", 1)
    series = FlightSeries()
    for t_s, error_m, late_ms in (
        *((65.0, 9.0, 50.0), (85.0, 8.0, 50.0), (4000.0, 5.0, 999.0)),
        *((7205.0, 2.0, 50.0), (7225.0, 0.1, 50.0)),
    ):
        series.error_m.append((t_s, error_m))
        series.latency_ms.append((t_s, late_ms))
        series.stages_ms.setdefault("match", []).append((t_s, late_ms))
    return Flight(summary, BLACK_BOX, 0, series, "{}", "", ())


def test_time_between_two_engagements_is_not_under_control(flight, tmp_path):
    assert flight.engagements == ((65.0, 85.0), (7205.0, 7225.0))
    page = make_report(Source(), flight, tmp_path / "film.webm")
    assert "40.0 s" in page
    assert "50 / 50 ms" in page
    assert "999.0" not in page


@pytest.mark.parametrize(
    ("shown", "name", "distances", "times_s"),
    [
        (0, "engagement 2 of 2", "2.000 → 0.100 m", (7202.0, 7228.0)),
        (1, "engagement 1 of 2", "9.000 → 8.000 m", (62.0, 88.0)),
    ],
)
def test_a_report_shows_one_engagement_and_says_which(
    shown, name, distances, times_s, flight, tmp_path
):
    flight = dataclasses.replace(flight, shown=shown)
    assert (flight.line.from_s, flight.line.to_s) == times_s
    page = make_report(Source(), flight, tmp_path / "film.webm")
    assert f"distance to the goal, estimated, {name}" in page
    assert distances in page


def test_the_goal_is_that_of_the_engagement_that_is_shown(flight, tmp_path):
    goals = tuple((t_s, np.full((8, 8, 3), t_s, np.uint8)) for t_s in (0.0, 200.0))

    def goal(shown, goals):
        changed = dataclasses.replace(flight, goals=goals, shown=shown)
        page = make_report(Source(), changed, tmp_path / "film.webm")
        return re.findall(r'<img src="([^"]*)" alt="Goal', page)

    assert goal(1, goals) == goal(1, goals[:1]) != goal(2, goals)
