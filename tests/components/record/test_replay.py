"""Perception run again on a recorded flight: the same bits, or what differs and why."""

import dataclasses
import functools
import json
import os
import subprocess
import sys

import depth_bundle
import numpy as np
import onnx_network
import pytest
from recorded_flight import fly, write_recording

from dfvs_core.messages.frame_record import FrameRecord, SessionHeader
from dfvs_service.replay.cli import main
from dfvs_service.replay.comparison import compare
from dfvs_service.replay.flight import Trial, replay


def rerun(path):
    return replay([path], Trial(), lambda _: None)


def assert_identical(path):
    """Every command is the same, as it must be; the comparison."""
    result = rerun(path)
    assert result.reasons == ()
    comparison = compare(result.frames)
    assert comparison.is_identical
    return comparison


def altered(events, kind, alter):
    """Events of which the messages of a kind went through ``alter``."""
    return [(alter(m) if isinstance(m, kind) else m, payload) for m, payload in events]


@pytest.fixture(scope="module")
def flight():
    return fly(np.random.default_rng(11), frames=16)


@pytest.fixture(scope="module")
def recording(flight, tmp_path_factory):
    return write_recording(tmp_path_factory.mktemp("recording"), flight.events)


def test_the_same_build_gives_the_same_commands_bit_for_bit(recording, flight):
    comparison = assert_identical(recording)
    assert len(comparison.frames) == sum(turn.sight is not None for turn in flight.turns)
    assert comparison.healthy_both > 8
    speeds = [abs(frame.replayed.velocity[1]) for frame in comparison.frames]
    assert max(speeds) > 0.05  # there was something to be the same


def test_time_taken_to_replay_changes_nothing(recording, monkeypatch):
    """What was recorded decides on a frame's age, not the clock of today."""
    monkeypatch.setattr("time.monotonic_ns", lambda: 0)
    assert compare(rerun(recording).frames).is_identical


def test_a_flight_at_another_working_size_is_replayed_at_it(tmp_path):
    """Measured before the flight, it is among the settings of the recording."""
    flight = fly(np.random.default_rng(11), 10, flow__working_width_px=240)
    assert flight.opening.settings["flow"]["working_width_px"] == 240
    assert_identical(write_recording(tmp_path, flight.events))
    events = altered(flight.events, SessionHeader, another_size)
    (tmp_path / "other").mkdir()
    assert not compare(rerun(write_recording(tmp_path / "other", events)).frames).is_identical


def another_size(header):
    flow = header.settings["flow"] | {"working_width_px": 160}
    return dataclasses.replace(header, settings=header.settings | {"flow": flow})


def test_a_goal_that_changed_in_flight_changes_in_replay(tmp_path):
    flight = fly(np.random.default_rng(12), 10, next_goal_at=5)
    comparison = assert_identical(write_recording(tmp_path, flight.events))
    before, after = (comparison.frames[i].replayed.error_m for i in (3, 4))
    assert abs(after - before) > 0.02  # another goal, indeed


@pytest.fixture(scope="module")
def previewed():
    """A flight whose second goal is tracked from its preview."""
    return fly(np.random.default_rng(12), 12, next_goal_at=8, preview_of=5)


def test_a_goal_tracked_from_its_preview_is_replayed_bit_for_bit(previewed, tmp_path):
    opening = next(m for m, _ in previewed.events if isinstance(m, SessionHeader) and m.first_turn)
    assert opening.observed_ns is not None
    assert_identical(write_recording(tmp_path, previewed.events))


@pytest.fixture
def wall_depth(tmp_path):
    """Folder of a network that sees a wall a little further on the right."""
    rho = np.tile(np.linspace(0.45, 0.35, 80), (60, 1))
    return onnx_network.write_bundle(tmp_path / "depth", depth_bundle.bundle(rho, by_image=0.05))


@pytest.mark.parametrize("depth", ["network", "fused"])
def test_a_flight_by_a_depth_network_is_replayed_bit_for_bit(depth, wall_depth, tmp_path):
    settings = {"servo__depth": depth, "depth__model": str(wall_depth)}
    rng = np.random.default_rng(12)
    flight = fly(rng, 12, next_goal_at=8, preview_of=5, **settings)
    assert "depth/mono.onnx" in flight.opening.model
    comparison = assert_identical(write_recording(tmp_path, flight.events))
    assert comparison.healthy_both > 4


def test_another_depth_network_is_named_as_the_reason_to_differ(wall_depth, tmp_path):
    settings = {"servo__depth": "fused", "depth__model": str(wall_depth)}
    flight = fly(np.random.default_rng(12), 6, **settings)
    other = depth_bundle.bundle(np.full((60, 80), 0.2))
    onnx_network.write_bundle(wall_depth, other)
    result = rerun(write_recording(tmp_path, flight.events))
    assert result.reasons == ("the depth network's files are others",)
    assert not compare(result.frames).is_identical


def test_without_the_preview_the_commands_differ(previewed, tmp_path):
    """The observation matters, so the session header has to tell its frame."""
    unseen = functools.partial(dataclasses.replace, observed_ns=None)
    events = altered(previewed.events, SessionHeader, unseen)
    assert not compare(rerun(write_recording(tmp_path, events)).frames).is_identical


def test_a_preview_whose_frame_was_not_recorded_is_named_as_the_reason_to_differ(
    previewed, tmp_path
):
    frame = next(i for i, (m, _) in enumerate(previewed.events) if getattr(m, "number", None) == 5)
    events = previewed.events[:frame] + previewed.events[frame + 1 :]
    result = rerun(write_recording(tmp_path, events))
    assert result.reasons == ("1 frame records before frame record 6 were not recorded",)


def nudge(turn):
    """One command differs in its last bit."""
    if turn.number != 12:
        return turn
    forward, *rest = turn.report.velocity
    report = dataclasses.replace(turn.report, velocity=(np.nextafter(forward, 1.0), *rest))
    return dataclasses.replace(turn, report=report)


def age(turn):
    """The servo step ran a millisecond later."""
    if turn.sight is None or turn.sight.t_servo_ns is None:
        return turn
    sight = dataclasses.replace(turn.sight, t_servo_ns=turn.sight.t_servo_ns + 1_000_000)
    return dataclasses.replace(turn, sight=sight)


def test_a_single_bit_that_differs_is_found_and_is_a_failure(flight, tmp_path, capsys):
    path = write_recording(tmp_path, altered(flight.events, FrameRecord, nudge))
    comparison = compare(rerun(path).frames)
    assert comparison.first_difference == 12
    assert len(comparison.frames) - comparison.identical == 1
    assert main([str(path)]) == 1
    assert "NOT identical" in capsys.readouterr().out


def test_the_times_of_judgement_matter_so_they_have_to_be_recorded(flight, tmp_path):
    path = write_recording(tmp_path, altered(flight.events, FrameRecord, age))
    comparison = compare(rerun(path).frames)
    assert comparison.identical < 0.5 * len(comparison.frames)
    assert 0 < comparison.velocity_m_s.greatest < 0.01


def test_turns_that_are_missing_are_named_as_the_reason_to_differ(flight, tmp_path):
    path = write_recording(tmp_path, [*flight.events[:4], *flight.events[9:]])
    result = rerun(path)
    assert result.reasons == ("5 frame records before frame record 8 were not recorded",)


def test_other_settings_give_a_report_of_what_differs(recording, tmp_path, capsys):
    settings, report = tmp_path / "other.toml", tmp_path / "report.html"
    settings.write_text(
        "[servo]\ngain_far = 0.4\ngain_near = 0.4\n[flow]\nmodel = 'classical'\nthreads = 1\n"
    )
    words = ["--config", str(settings), "--html", str(report), "--json", str(tmp_path / "r.json")]
    assert main([str(recording), *words]) == 0
    out = capsys.readouterr().out
    assert "the settings of [servo] are others" in out
    document = json.loads((tmp_path / "r.json").read_text())
    assert document["is_identical"] is False
    assert document["must_be_identical"] is False
    assert document["velocity_m_s"]["greatest"] > 0.01
    assert document["error_m"]["greatest"] < 1e-6  # the same eyes, another law
    assert len(document["frames"]) == document["identical"] + sum(
        not frame["identical"] for frame in document["frames"]
    )
    page = report.read_text()
    assert page.count("<svg") == 8
    assert "://" not in page  # it needs nothing from elsewhere
    assert "[servo] are others" in page


def test_another_model_is_tried_on_the_same_frames(recording):
    result = replay([recording], Trial(model="dfvs-flow"), lambda _: None)
    assert any("model" in reason for reason in result.reasons)
    assert len(result.frames) > 10


@pytest.mark.parametrize(
    ("words", "message"),
    [
        (["nowhere.mcap"], "cannot read nowhere.mcap"),
        (["."], "cannot read ."),
        (["RECORDING", "--bundle", "nowhere"], "there is no model 'nowhere'"),
        (["RECORDING", "--config", "nowhere.toml"], "nowhere.toml"),
        (["nowhere.mcap", "--json", "/nowhere/r.json"], "/nowhere/r.json lies in no folder"),
        (["nowhere.mcap", "--json", "/"], "--json / is a folder"),
        (["nowhere.mcap", "--html", "/"], "--html / is a folder"),
        (["nowhere.mcap", "--json", "/proc/self/r.json"], "--json /proc/self/r.json cannot be wri"),
        (["nowhere.mcap", "--html", "/proc/self/r.html"], "--html /proc/self/r.html cannot be wri"),
        (["nowhere.mcap", "--html", "r.pdf"], "a name that ends in .html"),
        ([__file__], "is not a recording"),
    ],
)
def test_bad_words_are_one_clear_line(recording, words, message, refused):
    words = [recording if word == "RECORDING" else word for word in words]
    assert message in refused(main, *words)


def test_as_a_command_of_its_own_it_finds_the_same(recording):
    """A process of its own, in an environment that asks for many BLAS threads.

    The rest of the environment stays: it may choose BLAS's kernels, and others give other bits.
    """
    command = [sys.executable, "-m", "dfvs_service.replay.cli", str(recording)]
    many = os.environ | {"OPENBLAS_NUM_THREADS": "4", "OMP_NUM_THREADS": "4"}
    done = subprocess.run(
        command, capture_output=True, text=True, timeout=60, check=False, env=many
    )
    assert done.returncode == 0, done.stderr
    assert done.stdout.startswith("identical: all")
