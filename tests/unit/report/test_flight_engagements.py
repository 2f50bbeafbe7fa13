"""The page about a flight by hand: engaged twice, once or never, with odd records."""

import dataclasses
import re

import numpy as np
import pytest

from dfvs_service.flights.records import FlightSummary, StateChange
from dfvs_service.report.flight import BLACK_BOX, Flight
from dfvs_service.report.flight_page import make_report
from dfvs_service.report.series import Fault, FlightSeries, SeriesBuilder

FLOWN = ((0, "READY"), (5, "ENGAGE"), (6, "SERVO"), (20, "DONE"), (25, "RELEASED"))


class Source:
    """Records of a flight, without a view."""

    name, video_rate_hz, note = "f", 10, ""

    def views(self):
        return iter(())


def flown(states, duration_s, series):
    changes = tuple(StateChange(t_s, state, "", "") for t_s, state in states)
    summary = FlightSummary("f", "", "", "", duration_s, "ended", 0, "", changes, (), "", 1)
    return Flight(summary, BLACK_BOX, 0, series, "{}", "", ())


@pytest.fixture
def flight():
    """Two flights of 20 s, two hours apart; by hand, frames are late and far from the goal."""
    series = FlightSeries()
    for t_s, error_m, late_ms in (
        *((65.0, 9.0, 50.0), (85.0, 8.0, 50.0), (4000.0, 5.0, 999.0)),
        *((7205.0, 2.0, 50.0), (7225.0, 0.1, 50.0)),
    ):
        series.error_m.append((t_s, error_m))
        series.latency_ms.append((t_s, late_ms))
        series.stages_ms.setdefault("match", []).append((t_s, late_ms))
    return flown([(t_s + s, state) for t_s in (60.0, 7200.0) for s, state in FLOWN], 7400.0, series)


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


def test_a_fault_that_began_before_the_plots_and_goes_on_in_them_is_told(tmp_path):
    faults = [Fault(1.0, 119.9, "the frame was old", 1190), Fault(1.0, 50.0, "over by then")]
    never_ready = flown([(0.5, "PREFLIGHT")], 120.0, FlightSeries(faults=faults))
    page = make_report(Source(), never_ready, tmp_path / "film.webm")
    assert "the frame was old" in page
    assert "over by then" not in page


@pytest.mark.parametrize(("state", "time"), [("SERVO", "9.5 s"), ("READY", "none")])
def test_records_that_begin_in_flight_have_a_time_under_control(state, time, tmp_path):
    page = make_report(Source(), flown([(0.5, state)], 10.0, FlightSeries()), tmp_path / "f.webm")
    assert f"<b>{time}</b><span>time under control</span>" in page


def test_a_frame_that_was_stamped_ahead_has_its_place_among_the_latencies(tmp_path):
    builder = SeriesBuilder(0)
    builder.add_servo({"t_ns": 10**9, "t_capture_ns": 10**9 + 5_000_000})
    flight = flown([(0.5, "SERVO")], 2.0, builder.series)
    assert "capture to command, median" in make_report(Source(), flight, tmp_path / "f.webm")


def test_a_flight_whose_states_were_lost_has_its_plots(tmp_path):
    flight = flown([], 2.0, FlightSeries(error_m=[(1.0, 0.5), (1.1, 0.4)]))
    assert "<polyline" in make_report(Source(), flight, tmp_path / "f.webm")
