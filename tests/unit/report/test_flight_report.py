"""The page about a flight: its curves, what it says, and that it needs nothing else."""

import json
import math
import re
import shutil

import cv2
import numpy as np
import pytest
from full_disk import no_file_above

from dfvs_core.gate.config import GateConfig, S
from dfvs_core.gate.events import Attitude, GateOutput, LocalPosition, Report
from dfvs_core.gate.limits import BodyVelocity
from dfvs_core.gate.replay import encode_gap, encode_start, encode_step
from dfvs_core.messages.link import PerceptionReport
from dfvs_service.flights.store import FlightStore
from dfvs_service.report.black_box import BlackBoxFlight
from dfvs_service.report.cli import main
from dfvs_service.report.flight_page import make_report

START_NS = 100 * S
OUTPUT = GateOutput(BodyVelocity(0.1, 0.2, 0.3, 0.4))
NOTHING = "Nothing was recorded."


def flight_page(folder):
    source = BlackBoxFlight(folder)
    return make_report(source, source.read(), folder.parent / "film.webm")


def series_of(folder):
    header = {"vehicle": "drone1", "started_ns": START_NS, "started_unix_ns": 1_700_000_000 * S}
    (folder / "flight.json").write_text(json.dumps(header) + "\n")
    return BlackBoxFlight(folder).read().series


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


def servo(t_s, match_ms):
    t_ns = START_NS + round(t_s * S)
    document = {"t_ns": t_ns, "t_capture_ns": t_ns - 40_000_000, "stages_ms": {"match": match_ms}}
    return {"stream": "servo", "data": {**document, "error_m": 1.0, "error_spread_m": 0.1}}


@pytest.fixture
def store(tmp_path, monkeypatch):
    monkeypatch.setenv("XDG_STATE_HOME", str(tmp_path))
    monkeypatch.delenv("STATE_DIRECTORY", raising=False)
    return FlightStore(tmp_path / "dfvs" / "flights")


@pytest.fixture
def bare(store):
    """A flight without any record."""
    folder, lock = store.create("drone1", 1_700_000_000.0)
    lock.close()
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
    limits = {"tolerance_m": 0.02, "tolerance_rad": 0.0087, "min_confidence": 0.3}
    (bare / "settings.json").write_text(
        json.dumps({"vehicle": {"name": "drone1"}, "servo": limits})
    )
    moves = [
        (5 + t / 10, [yaw(5, 0), position(5 + t / 10, (t / 10, 0, -2), (1, 0, 0)), report(5, 1)])
        for t in range(30)
    ]
    write_inputs(bare, moves)
    cv2.imwrite(str(bare / "goal.png"), np.full((48, 64, 3), 90, np.uint8))
    told = [servo(6.0, 12.34), servo(6.1, 12.34), servo(6.2, 56.78)]
    (bare / "telemetry-000.jsonl").write_text("".join(json.dumps(r) + "\n" for r in told))
    return bare


@pytest.fixture
def filmed(flight):
    """The same flight with a view a second."""
    (flight / "thumbnails").mkdir()
    for t_s in range(1, 9):
        name = flight / "thumbnails" / f"{START_NS + t_s * S}.jpg"
        cv2.imwrite(str(name), np.full((180, 240, 3), 20 * t_s, np.uint8))
    return flight


def test_the_flown_velocity_is_turned_into_the_level_body_frame(bare):
    write_inputs(bare, [(1, [yaw(1, 90), position(1, (5, 6, 7), (0.5, 2.0, 0.25))])])
    series = series_of(bare)
    # Heading east: forward is east, right is south.
    assert [curve[0][1] for curve in series.flown[:3]] == pytest.approx([2.0, -0.5, 0.25])
    assert [curve[0] for curve in series.commanded] == [(1.0, k) for k in (0.1, 0.2, 0.3, 0.4)]


def test_path_distance_and_height_are_relative_to_the_first_position(bare):
    points = [(5.0, 6.0, -2.0), (8.0, 10.0, -2.0), (5.0, 6.0, -3.5)]
    write_inputs(bare, [(t / 10, [position(t / 10, p, (0, 0, 0))]) for t, p in enumerate(points)])
    series = series_of(bare)
    assert [place for _, *place in series.path] == [[0.0, 0.0], [3.0, 4.0], [0.0, 0.0]]
    assert [value for _, value in series.from_start_m] == [0.0, 5.0, 1.5]
    assert [value for _, value in series.height_m] == [0.0, 0.0, 1.5]


def test_curves_are_interrupted_where_nothing_was_seen_or_heard(bare):
    events = [report(1.0, 3.0), report(1.1, 9.0, healthy=False), report(1.2, 2.0), report(3.0, 1.0)]
    write_inputs(bare, [(e.t_ns / S - 100, [e]) for e in events])
    values = [value for _, value in series_of(bare).error_m]
    assert [v for v in values if not math.isnan(v)] == [3.0, 2.0, 1.0]
    assert [math.isnan(v) for v in values] == [False, True, False, True, False]


@pytest.mark.parametrize("tail", ["", '{"t":1', "\0\0\0", "garbage\n", encode_gap(3) + "\n"])
def test_curves_go_as_far_as_the_records(tail, bare):
    write_inputs(bare, [(1, [report(1, 3.0)])])
    with (bare / "gate-inputs.jsonl").open("a") as file:
        file.write(tail)
    assert series_of(bare).error_m == [(1.0, 3.0)]


def test_curves_go_on_after_steps_that_were_left_out(bare):
    write_inputs(bare, [(1, [report(1, 3.0)])])
    with (bare / "gate-inputs.jsonl").open("a") as file:
        step = encode_step(START_NS + 2 * S, [report(2, 2.0)], OUTPUT)
        file.write(f"{encode_gap(3)}\n{step}\n")
    assert (2.0, 2.0) in series_of(bare).error_m


def test_the_page_says_what_happened(flight):
    text = flight_page(flight)
    assert '<header class="bad">' in text
    assert '<p class="verdict">Ended in ABORT: c' in text
    assert '<td class="number">12.3</td><td class="number">55.9</td>' in text
    assert "&#34;name&#34;: &#34;drone1&#34;" in text
    assert NOTHING not in text


def test_the_states_are_under_every_plot_of_the_same_time(flight):
    plots = re.findall(r"<svg[^>]*data-from.*?</svg>", flight_page(flight), re.DOTALL)
    assert len(plots) == 9
    bars = {tuple(re.findall(r'<rect class="state (\w+)" x="([\d.]+)"', plot)) for plot in plots}
    (same,) = bars
    # From 1 s, 3 s before ENGAGE, to the end at 9 s, over 454 px from 56 px on.
    place = {state: float(x) for state, x in same}
    assert place == pytest.approx(
        {"PREFLIGHT": 56, "ENGAGE": 226.2, "SERVO": 283, "ABORT": 453.2}, abs=0.1
    )


def test_what_the_records_say_cannot_become_a_part_of_the_page(flight):
    text = flight_page(flight)
    assert "<script>alert" not in text
    assert text.count("<script") == 1  # the page's own, which its policy names by its digest
    assert "&lt;script&gt;" in text


def test_the_page_needs_nothing_else(filmed):
    text = flight_page(filmed)
    sources = {source.partition(",")[0] for source in re.findall(r'src="([^"]{0,30})', text)}
    assert sources == {"data:image/jpeg;base64", "data:video/webm;base64"}
    assert re.findall(r'href="([^"]*)', text) == ["film.webm"]
    assert "url(" not in text
    assert "@import" not in text


def test_a_flight_without_any_record_has_a_page_that_says_so(bare):
    text = flight_page(bare)
    assert "Cut off in IDLE" in text
    assert text.count(NOTHING) == 10
    assert "<video" not in text
    assert not (bare.parent / "film.webm").exists()


def test_a_flight_that_stood_still_has_plots_all_the_same(flight):
    still = [(5, [position(5, (1, 1, 1), (0, 0, 0)), report(5, 0.0)])]
    write_inputs(flight, still)
    assert NOTHING not in flight_page(flight)


def frames_of(film):
    """Each frame's bytes: the file itself holds a random number."""
    video = cv2.VideoCapture(str(film))
    frames = []
    while (read := video.read())[0]:
        frames.append(read[1].tobytes())
    assert frames
    return frames


def without_film(page):
    return re.sub(r"data:video/webm;base64,[\w+/=]+", "", page)


def test_the_command_takes_a_name_or_a_folder(filmed, tmp_path, monkeypatch, capsys):
    monkeypatch.chdir(tmp_path)
    (tmp_path / "latest").mkdir()  # no flight, and not what is asked for
    assert main(["latest"]) == 0
    assert main([str(filmed), "--out", "other.html"]) == 0
    expected = flight_page(filmed)
    film = filmed.parent / "film.webm"
    for name in (filmed.name, "other"):
        assert frames_of(tmp_path / f"{name}.webm") == frames_of(film)
        page = (tmp_path / f"{name}.html").read_text()
        assert without_film(page) == without_film(expected).replace(film.name, f"{name}.webm")
    assert capsys.readouterr().out.splitlines()[1] == (
        f"wrote {filmed.name}.html and {filmed.name}.webm"
    )
    filmed.rename("mine")
    assert main(["mine"]) == 0


@pytest.mark.parametrize(
    ("words", "told"),
    [
        (["20000101T000000Z-drone1"], "there is no flight"),
        (["/no/such/folder"], "there is no folder"),
        (["latest", "--out", "/no/such/folder/x.html"], "/no/such/folder/x.html lies in no folder"),
        (["latest", "--out", "/"], "--out / is a folder"),
        (["latest", "--out", "flight.pdf"], "'flight.pdf'; expected a name that ends in .html"),
        (["latest", "--film", "/no/such/folder/x.webm"], "x.webm lies in no folder"),
        (["latest", "--film", "/proc/self/x.webm"], "--film /proc/self/x.webm cannot be written"),
        (["latest", "--out", "/proc/self/x.html", "--film", "x.webm"], "x.html cannot be written"),
        (["latest", "--film", "film.avi"], "'film.avi'; expected a name that ends in .webm"),
        (["latest", "--engagement", "2"], "--engagement 2; the flight has 1"),
        (["latest", "--truth", "/no/such/file"], "cannot be read from /no/such/file"),
        (["latest", "20000101T000000Z-drone1"], "2 flights"),
        (["/no/such/recording.mcap"], "cannot read /no/such/recording.mcap"),
    ],
)
def test_what_cannot_be_is_said_in_one_line(words, told, flight, refused):
    assert told in refused(main, *words)


def test_a_missing_package_is_named_with_its_remedy(flight, monkeypatch, refused):
    monkeypatch.setattr("importlib.util.find_spec", lambda _name: None)
    assert "pip install 'dfvs[report]'" in refused(main, "latest")


def test_the_film_lasts_as_long_as_the_plots_and_says_where_its_views_come_from(filmed):
    text = flight_page(filmed)
    film = cv2.VideoCapture(str(filmed.parent / "film.webm"))
    seconds = film.get(cv2.CAP_PROP_FRAME_COUNT) / film.get(cv2.CAP_PROP_FPS)
    assert seconds == pytest.approx(8.0, abs=0.5)  # from 1 s to 9 s
    assert "The black box keeps one small view a second" in text
    # The view of 6 s is shown 5.5 s after the film's begin; no text stands in its middle.
    film.set(cv2.CAP_PROP_POS_FRAMES, 11)
    assert film.read()[1][100:300, 100:400].mean() == pytest.approx(120, abs=6)


def test_the_last_view_is_the_same_wherever_it_is_shown(filmed):
    text = flight_page(filmed)
    # ABORT came at 8 s, and a view with it.
    (last,) = re.findall(r'<img src="([^"]*)" alt="Last view under control, 8.0 s', text)
    strip = re.findall(r'<section class="strip">.*?</section>', text, re.DOTALL)[0]
    assert re.findall(r'src="([^"]*)"', strip)[-1] == last


def test_a_distance_below_the_tolerance_lies_in_the_part_that_is_marked(flight):
    good = [(5 + t / 10, [report(5 + t / 10, 0.5 * 0.8**t)]) for t in range(30)]
    write_inputs(flight, good)
    chart = re.findall(r"<h3>Distance.*?</svg>", flight_page(flight), re.DOTALL)[0]
    marked = float(re.findall(r'class="reached" x="56" y="([\d.]+)"', chart)[0])
    places = re.findall(r'polyline class="flown" points="([^"]*)"', chart)[0].split()
    heights = [float(place.split(",")[1]) for place in places]
    assert [height > marked for height in heights] == [0.5 * 0.8**t < 0.02 for t in range(30)]
    assert "goal: below 0.02 m" in chart


def test_faults_of_frames_that_follow_each_other_are_one_line(flight):
    bad = [(5 + t / 10, [report(5 + t / 10, 1, healthy=False)]) for t in range(5)]
    write_inputs(flight, [*bad, (7, [report(7, 1, healthy=False)])])
    faults = BlackBoxFlight(flight).read().series.faults
    assert [(f.from_s, f.to_s, f.count) for f in faults] == [(5.0, 5.4, 5), (7.0, 7.0, 1)]
    assert flight_page(flight).count("no valid frame") == 2


def test_the_truth_of_a_simulation_is_drawn_beside_the_estimate(flight, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    lines = [
        {"t_ns": START_NS + round((4 + t / 10) * S), "error_m": 1 - t / 50, "error_rad": 0.1}
        for t in range(40)
    ]
    (tmp_path / "truth.jsonl").write_text("".join(json.dumps(line) + "\n" for line in lines))
    assert main(["latest", "--truth", "truth.jsonl", "--out", "true.html"]) == 0
    text = (tmp_path / "true.html").read_text()
    assert "true, of the simulation" in text
    assert "1.000 → 0.220 m" in text


@pytest.fixture
def older(filmed, tmp_path, monkeypatch):
    """Page and film of an earlier report on the same flight, with their bytes."""
    monkeypatch.chdir(tmp_path)
    assert main(["latest", "--out", "x.html"]) == 0
    return files_of(tmp_path)


def files_of(folder):
    return {path.name: path.read_bytes() for path in folder.iterdir() if path.is_file()}


def test_a_film_that_cannot_be_encoded_changes_nothing(older, tmp_path, monkeypatch, refused):
    monkeypatch.setattr("dfvs_service.report.video._CODEC", "none")
    error = refused(main, "latest", "--out", "x.html")
    assert "no video can be written to x.webm" in error
    assert files_of(tmp_path) == older


def test_a_film_that_the_disk_has_no_room_for_changes_nothing(older, tmp_path, refused):
    with no_file_above(len(older["x.webm"]) // 2):
        error = refused(main, "latest", "--out", "x.html")
    assert "x.webm cannot be written" in error
    assert files_of(tmp_path) == older


def test_a_flight_without_views_takes_an_older_film_away(older, filmed, tmp_path):
    shutil.rmtree(filmed / "thumbnails")
    assert main(["latest", "--out", "x.html"]) == 0
    assert files_of(tmp_path).keys() == {"x.html"}


def test_the_command_gives_its_result_as_json(filmed, tmp_path, monkeypatch, capsys):
    monkeypatch.chdir(tmp_path)
    assert main(["latest", "--out", "x.html", "--json"]) == 0
    result = json.loads(capsys.readouterr().out)
    assert result["files"] == ["x.html", "x.webm"]
    assert result["verdict"].startswith("ended in ABORT")


def test_of_a_flight_that_was_never_engaged_the_last_minute_is_shown(flight):
    (flight / "gate.jsonl").write_text("")
    end = {"t_ns": START_NS + 3600 * S, "kind": "end", "code": 1}
    (flight / "service.jsonl").write_text(json.dumps(end) + "\n")
    line = BlackBoxFlight(flight).read().line
    assert (line.from_s, line.to_s) == pytest.approx((3537, 3600))


def test_a_view_is_not_shown_before_its_time(filmed):
    for t_s in (1, 2, 3):
        (filmed / "thumbnails" / f"{START_NS + t_s * S}.jpg").unlink()
    flight_page(filmed)
    film = cv2.VideoCapture(str(filmed.parent / "film.webm"))
    middle = [film.read()[1][100:300, 100:400].mean() for _ in range(8)]
    # From 1 s to 4 s there is none; the first one has a grey of 80.
    assert middle[:6] == pytest.approx([0] * 6, abs=6)
    assert middle[6:] == pytest.approx([80] * 2, abs=6)
