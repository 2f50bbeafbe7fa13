"""What a report reads of a recording (MCAP)."""

import itertools
import math
from dataclasses import replace

import numpy as np
import pytest
from recorded_flight import fly, write_recording

from dfvs_service.record.reading import RecordingError
from dfvs_service.replay.flight import Trial, replay
from dfvs_service.report.recording import RecordedFlight


@pytest.fixture(scope="module")
def flight():
    return fly(np.random.default_rng(7), frames=16, next_goal_at=9)


@pytest.fixture(scope="module")
def source(flight, tmp_path_factory):
    return RecordedFlight([write_recording(tmp_path_factory.mktemp("flight"), flight.events)])


def test_curves_hold_what_the_gate_and_perception_said(source, flight):
    series = source.read().series
    heard = [status for turn in flight.turns for status in turn.heard]
    assert [value for _, value in series.commanded[1]] == [0.25] * len(heard)
    seen = [turn.report.error_m for turn in flight.turns if turn.report.healthy]
    assert [v for _, v in series.error_m if not math.isnan(v)] == seen
    times = [(turn.t_ns - flight.opening.opened_ns) * 1e-9 for turn in flight.turns]
    assert [t for t, _ in series.error_m] == pytest.approx(times)
    # It drifts to the east, 2 cm a frame and 4 mm a status.
    (_, north, east) = series.path[-1]
    assert (north, east) == pytest.approx((0.0, 0.02 * 15 + 0.008), abs=1e-9)


def test_views_have_the_flow_that_was_flown_by(source, flight):
    views = list(source.views())
    assert source.note == ""  # the same build: the flow is that of the flight
    usable = [t for t in flight.turns if t.sight is not None]
    assert len(views) == len(usable) - 1  # one sample is rubbish
    assert all(a.t_s < b.t_s for a, b in itertools.pairwise(views))
    healthy = [turn for turn in usable if turn.report.healthy]
    assert sum(view.flow is not None for view in views) == len(healthy) > 8
    assert all(view.flow.flow.shape[:2] == view.image.shape[:2] for view in views if view.flow)


def test_the_goal_is_the_one_of_the_time(source, flight):
    read = source.read()
    first, second = (image for _, image in read.goals)
    change_s = read.goals[1][0]
    assert (read.goal_at(change_s - 0.01) == first).all()
    assert (read.goal_at(change_s) == second).all()
    assert not (first == second).all()


@pytest.mark.parametrize(
    ("state", "is_reached", "cause", "verdict"),
    [
        ("HOLD", False, "tested", "the recording ends in HOLD: tested"),
        ("IDLE", False, "", "the recording ends in IDLE"),
        ("ABORT", True, "tested", "the goal was reached"),
    ],
)
def test_the_verdict_is_that_of_the_last_status(state, is_reached, cause, verdict, tmp_path):
    """A goal was reached; what follows is about another one, or about the same."""
    told = [("SERVO", False), ("DONE", True), (state, is_reached, cause)]
    opening, *records = fly(np.random.default_rng(7), len(told)).events
    events = [(heard(m, *says), data) for (m, data), says in zip(records, told, strict=True)]
    summary = RecordedFlight([write_recording(tmp_path, [opening, *events])]).read().summary
    assert summary.verdict == verdict
    assert summary.exit_code == (0 if is_reached else None)


def heard(record, state, is_reached=False, cause="tested"):
    """Frame record whose statuses say that, of a state that was entered with it."""
    said = {"state": state, "reached": is_reached, "cause": cause, "since_ns": record.t_ns}
    return replace(record, heard=tuple(replace(status, **said) for status in record.heard))


def test_a_state_of_another_run_has_its_own_cause_and_engagement(tmp_path):
    events = []
    for seed, cause in ((7, "perception silent"), (8, "goal lost")):
        header, (record, data), *_ = fly(np.random.default_rng(seed), 1).events
        events += [header, (heard(record, "HOLD", cause=cause), data)]
        events.append((replace(record, number=1, heard=(), t_ns=record.t_ns + 10**9), data))
    read = RecordedFlight([write_recording(tmp_path, events)]).read()
    assert read.summary.verdict == "the recording ends in HOLD: goal lost"
    assert [change.cause for change in read.summary.states] == ["perception silent", "goal lost"]
    assert [to_s - from_s for from_s, to_s in read.engagements] == pytest.approx([1.0, 1.0])


def test_two_runs_of_the_service_follow_each_other_and_are_named(tmp_path):
    """After a reboot monotonic time begins anew."""
    first = fly(np.random.default_rng(7), 4, next_goal_at=2)
    second = fly(np.random.default_rng(8), 4)
    assert second.opening.opened_ns < first.turns[-1].t_ns
    path = write_recording(tmp_path, [*first.events, *second.events])
    source = RecordedFlight([path])
    read = source.read()
    times = [t for t, v in read.series.error_m]
    assert times == sorted(times)
    assert read.series.path == sorted(read.series.path)
    ended_s = (first.turns[-1].t_ns - first.opening.opened_ns) * 1e-9
    began_s = read.goals[-1][0]
    assert began_s == pytest.approx(ended_s + 1.0)
    lasted_s = (second.turns[-1].t_ns - second.opening.opened_ns) * 1e-9
    assert read.summary.duration_s == pytest.approx(began_s + lasted_s)
    (several,) = read.summary.told
    assert several.startswith("the recording holds 2 runs of the service, which begin at 0.0 s (")
    views = [view.t_s for view in source.views()]
    assert views == sorted(views)
    assert sum(t_s > began_s for t_s in views) == 4
    replayed = replay([path], Trial(), lambda _: None)
    assert list(replayed.times_s) == sorted(replayed.times_s)
    assert replayed.times_s[-1] > began_s


def test_a_run_that_was_joined_after_a_change_of_goal_is_the_same_alone_and_after_another(tmp_path):
    before = fly(np.random.default_rng(7), 5)
    change, *records = fly(np.random.default_rng(8), 8, next_goal_at=5).events[6:]
    assert change[0].first_turn == 5
    files = [tmp_path / name for name in ("alone", "both")]
    for folder, events in zip(files, ([], before.events), strict=True):
        folder.mkdir()
        write_recording(folder, [*events, change, *records])
    alone, both = (replay([f / "flight-000.mcap"], Trial(), lambda _: None) for f in files)
    assert both.reasons == alone.reasons
    assert both.reasons == ("5 frame records before frame record 5 were not recorded",)
    assert [f.report for f in both.frames][-len(alone.frames) :] == [f.report for f in alone.frames]
    (several,) = RecordedFlight([files[1] / "flight-000.mcap"]).read().summary.told
    assert several.startswith("the recording holds 2 runs of the service")


def test_files_of_two_vehicles_are_refused_by_their_names(tmp_path):
    files = []
    for vehicle, seed in (("drone1", 7), ("drone2", 8)):
        (tmp_path / vehicle).mkdir()
        (header, image), *records = fly(np.random.default_rng(seed), 2).events
        events = [(replace(header, vehicle=vehicle), image), *records]
        files.append(write_recording(tmp_path / vehicle, events))
    with pytest.raises(RecordingError, match="of drone1 and of drone2; expected the files of one"):
        RecordedFlight(files).read()
