"""The page about a flight: its curves, what it says, and that it needs nothing else."""

import json
import math
import re

import cv2
import numpy as np
import pytest

from dfvs_core.gate.config import GateConfig, S
from dfvs_core.gate.events import Attitude, GateOutput, LocalPosition, Report
from dfvs_core.gate.limits import BodyVelocity
from dfvs_core.gate.replay import encode_gap, encode_start, encode_step
from dfvs_core.wire.link import PerceptionReport
from dfvs_service.flights.store import FlightStore
from dfvs_service.report.cli import main
from dfvs_service.report.page import flight_page
from dfvs_service.report.series import read_series

START_NS = 100 * S
OUTPUT = GateOutput(BodyVelocity(0.1, 0.2, 0.3, 0.4))
NOTHING = "Nothing was recorded."


def report(t_s, error_m, *, healthy=True):
    t_ns = START_NS + round(t_s * S)
    seen = PerceptionReport(1, t_ns, (0.0,) * 4, healthy, False, False, "", error_m, 0.1, 0.8)
    return Report(t_ns, seen)


def position(t_s, where, velocity):
    return LocalPosition(START_NS + round(t_s * S), where, velocity)


def yaw(t_s, degrees):
    return Attitude(START_NS + round(t_s * S), 0.0, 0.0, math.radians(degrees))


def write_inputs(folder, steps):
    """Steps as (time in s, events); every one commands the same."""
    lines = [encode_start(GateConfig(), START_NS)]
    lines += [encode_step(START_NS + round(t * S), events, OUTPUT) for t, events in steps]
    (folder / "gate-inputs.jsonl").write_text("".join(f"{line}\n" for line in lines))


@pytest.fixture
def store(tmp_path, monkeypatch):
    monkeypatch.setenv("XDG_STATE_HOME", str(tmp_path))
    monkeypatch.delenv("STATE_DIRECTORY", raising=False)
    return FlightStore(tmp_path / "dfvs" / "flights")


@pytest.fixture
def bare(store):
    """A flight without any record."""
    folder, lock = store.create("drone1", 1_700_000_000.0)
    lock.release()
    return folder


@pytest.fixture
def flight(bare):
    """A flight that ended in ABORT."""
    header = {"vehicle": "drone1", "started_ns": START_NS, "started_unix_ns": 1_700_000_000 * S}
    (bare / "flight.json").write_text(json.dumps(header) + "\n")
    states = [(0.5, "PREFLIGHT", ""), (4.0, "ENGAGE", ""), (5.0, "SERVO", "")]
    states += [(8.0, "ABORT", "<script>alert(1)</script>")]
    log = [
        {"t_ns": START_NS + round(t * S), "kind": "transition", "target": s, "cause": "c" + d}
        for t, s, d in states
    ]
    (bare / "gate.jsonl").write_text("".join(json.dumps(record) + "\n" for record in log))
    end = {"t_ns": START_NS + 9 * S, "kind": "end", "code": 1}
    (bare / "service.jsonl").write_text(json.dumps(end) + "\n")
    (bare / "settings.json").write_text('{"vehicle": {"name": "drone1"}}')
    moves = [
        (5 + t / 10, [yaw(5, 0), position(5 + t / 10, (t / 10, 0, -2), (1, 0, 0)), report(5, 1)])
        for t in range(30)
    ]
    write_inputs(bare, moves)
    cv2.imwrite(str(bare / "goal.png"), np.full((48, 64, 3), 90, np.uint8))
    stages = {"match": {"p50_ms": 12.34, "p99_ms": 56.78}}
    servo = {"t_ns": START_NS + 6 * S, "t_capture_ns": START_NS + 6 * S - 40_000_000}
    told = [{"stream": "servo", "data": servo}, {"stream": "timing", "data": {"stages": stages}}]
    (bare / "telemetry-000.jsonl").write_text("".join(json.dumps(r) + "\n" for r in told))
    return bare


def test_the_flown_velocity_is_turned_into_the_level_body_frame(bare):
    write_inputs(bare, [(1, [yaw(1, 90), position(1, (5, 6, 7), (0.5, 2.0, 0.25))])])
    series = read_series(bare, START_NS)
    # Heading east: forward is east, right is south.
    assert [curve[0][1] for curve in series.flown] == pytest.approx([2.0, -0.5, 0.25])
    assert [curve[0] for curve in series.commanded] == [(1.0, 0.1), (1.0, 0.2), (1.0, 0.3)]


def test_path_distance_and_height_are_relative_to_the_first_position(bare):
    points = [(5.0, 6.0, -2.0), (8.0, 10.0, -2.0), (5.0, 6.0, -3.5)]
    write_inputs(bare, [(t / 10, [position(t / 10, p, (0, 0, 0))]) for t, p in enumerate(points)])
    series = read_series(bare, START_NS)
    assert series.path == [(0.0, 0.0), (3.0, 4.0), (0.0, 0.0)]
    assert [value for _, value in series.from_start_m] == [0.0, 5.0, 1.5]
    assert [value for _, value in series.height_m] == [0.0, 0.0, 1.5]


def test_curves_are_interrupted_where_nothing_was_seen_or_heard(bare):
    events = [report(1.0, 3.0), report(1.1, 9.0, healthy=False), report(1.2, 2.0), report(3.0, 1.0)]
    write_inputs(bare, [(e.t_ns / S - 100, [e]) for e in events])
    values = [value for _, value in read_series(bare, START_NS).error_m]
    assert [v for v in values if not math.isnan(v)] == [3.0, 2.0, 1.0]
    assert [math.isnan(v) for v in values] == [False, True, False, True, False]


@pytest.mark.parametrize("tail", ["", '{"t":1', "\0\0\0", "garbage\n", encode_gap(3) + "\n"])
def test_curves_go_as_far_as_the_records(tail, bare):
    write_inputs(bare, [(1, [report(1, 3.0)])])
    with (bare / "gate-inputs.jsonl").open("a") as file:
        file.write(tail)
    assert read_series(bare, START_NS).error_m == [(1.0, 3.0)]


def test_the_page_says_what_happened(flight):
    text = flight_page(flight)
    assert '<p class="verdict bad">Ended in ABORT: c' in text
    assert "12.3" in text
    assert "56.8" in text
    assert "&#34;name&#34;: &#34;drone1&#34;" in text
    assert NOTHING not in text


def test_the_states_are_under_every_plot_of_the_same_time(flight):
    plots = re.findall(r'<div class="wide"><svg.*?</svg>', flight_page(flight), re.DOTALL)
    assert len(plots) == 8
    bars = {tuple(re.findall(r'<rect class="state (\w+)" x="([\d.]+)"', plot)) for plot in plots}
    (same,) = bars
    # From 1 s, 3 s before ENGAGE, to 9 s, over 904 px from 82 px on.
    place = {state: float(x) for state, x in same}
    assert place == pytest.approx(
        {"PREFLIGHT": 82, "ENGAGE": 421, "SERVO": 534, "ABORT": 873}, abs=0.1
    )


def test_what_the_records_say_cannot_become_a_part_of_the_page(flight):
    text = flight_page(flight)
    assert "<script" not in text
    assert "&lt;script&gt;" in text


def test_the_page_needs_nothing_else(flight):
    text = flight_page(flight)
    sources = re.findall(r'(?:src|href)="([^"]{0,30})', text)
    assert sources
    assert all(source.startswith("data:image/jpeg;base64,") for source in sources)
    assert "url(" not in text


def test_a_flight_without_any_record_has_a_page_that_says_so(bare):
    text = flight_page(bare)
    assert "Cut off in IDLE" in text
    assert text.count(NOTHING) == 9


def test_a_flight_that_stood_still_has_plots_all_the_same(flight):
    still = [(5, [position(5, (1, 1, 1), (0, 0, 0)), report(5, 0.0)])]
    write_inputs(flight, still)
    assert NOTHING not in flight_page(flight)


def test_the_command_takes_a_name_or_a_folder(flight, tmp_path, monkeypatch, capsys):
    monkeypatch.chdir(tmp_path)
    assert main(["latest"]) == 0
    assert main([str(flight), "--out", "other.html"]) == 0
    expected = flight_page(flight)
    assert (tmp_path / f"{flight.name}.html").read_text() == expected
    assert (tmp_path / "other.html").read_text() == expected
    assert capsys.readouterr().out.splitlines()[0] == f"wrote {flight.name}.html"


@pytest.mark.parametrize(
    ("words", "told"),
    [
        (["20000101T000000Z-drone1"], "there is no flight"),
        (["/no/such/folder"], "there is no folder"),
        (["latest", "--out", "/no/such/folder/x.html"], "No such file or directory"),
    ],
)
def test_what_cannot_be_is_said_in_one_line(words, told, flight, capsys):
    assert main(words) == 2
    (line,) = capsys.readouterr().err.splitlines()
    assert line.startswith("error: ")
    assert told in line


def test_a_missing_package_is_named_with_its_remedy(flight, monkeypatch, capsys):
    monkeypatch.setattr("importlib.util.find_spec", lambda _name: None)
    assert main(["latest"]) == 2
    assert "pip install 'dfvs[report]'" in capsys.readouterr().err
