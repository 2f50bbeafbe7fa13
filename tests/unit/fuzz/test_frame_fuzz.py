"""Hostile frames through the decoder, and proof that a decoder that is not safe is noticed."""

import json
import mmap

import numpy as np
import pytest
from subcommand import run_subcommand

from dfvs_core.messages import frame as wire_frame
from dfvs_core.perception import frame_validator
from dfvs_robustness.commands import fuzz
from dfvs_robustness.commands.fuzz_frames import figures
from dfvs_robustness.fuzz.frames.decoding import (
    FrameOutcome,
    corpus_of,
    feed,
    hostile_frame,
)
from dfvs_robustness.fuzz.frames.hostile_frames import KINDS


def run(*words):
    return run_subcommand(fuzz, "frames", *words)


def test_a_thousand_hostile_frames_do_no_harm(tmp_path, capsys):
    path = tmp_path / "frames.json"
    assert run("--count", 1000, "--seed", 5, "--json", path) == 0, capsys.readouterr().out
    report = json.loads(path.read_text())
    assert (report["frames"], report["flaws"], report["verdict"]) == (1000, [], "passed")
    assert set(report["kinds"]) == set(KINDS)
    # Bombs must be bombs, and not fail for a trifle: these never come through, good frames do.
    kinds = report["kinds"]
    assert kinds["PNG of a huge size"]["admitted"] == 0
    assert kinds["good"]["admitted"] > 0.8 * kinds["good"]["frames"]
    assert 100 < report["admitted"] < 700


def test_without_a_good_frame_nothing_is_compared_and_the_run_fails(tmp_path, capsys):
    path = tmp_path / "frames.json"
    assert run("--count", 2, "--json", path) == 1
    assert "no good frame" in capsys.readouterr().out
    report = json.loads(path.read_text(), parse_constant=pytest.fail)
    assert (report["good_p99_ms"], report["slowest_over_good"]) == (None, None)


def trusting(payload, header):
    shape = (header.height, header.width, 3)
    return wire_frame.Frame(np.frombuffer(payload, np.uint8).reshape(shape), 0, 0)


@pytest.mark.parametrize(
    ("name", "broken", "flaw"),
    [
        ("decode_frame", trusting, "escape"),
        ("check_header", lambda state, *rest: (None, state), "image of shape"),
        ("MAX_AGE_NS", 0, "good frame was refused"),
    ],
    ids=["an exception escapes", "the wrong size is taken", "a good frame is refused"],
)
def test_a_flaw_of_a_broken_decoder_is_found(name, broken, flaw, monkeypatch):
    monkeypatch.setattr(frame_validator, name, broken)
    report = figures(feed(0, range(250)), 0)
    assert report["verdict"] == "failed"
    assert any(flaw in found["flaw"] for found in report["flaws"])


def test_memory_beyond_a_good_frames_fails(monkeypatch):
    honest = frame_validator.decode_frame
    held = []

    def greedy(payload, header):
        pages = mmap.mmap(-1, 4 << 20)  # new pages, which malloc cannot take from what it keeps
        pages.write(b"1" * len(pages))
        held.append(pages)
        return honest(payload, header)

    monkeypatch.setattr(frame_validator, "decode_frame", greedy)
    report = figures(feed(0, range(60)), 0)
    assert report["flaws"] == []
    assert report["max_peak_kib"] > 3500
    assert report["verdict"] == "failed"


def test_time_beyond_a_good_frames_fails():
    outcome = FrameOutcome()
    outcome.kinds["good"].see(admitted=True, took_ms=1.0, peak_kib=0)
    outcome.kinds["noise"].see(admitted=False, took_ms=19.0, peak_kib=0)
    assert figures(outcome, 0)["verdict"] == "passed"
    outcome.kinds["noise"].see(admitted=False, took_ms=21.0, peak_kib=0)
    assert figures(outcome, 0)["verdict"] == "failed"


def test_growth_counts_after_the_warm_up():
    outcome = FrameOutcome()
    outcome.resident_kib[7] += [100, 900, 1000, 1500, 6000]
    assert outcome.growth_kib == 5000


def test_what_was_freed_and_not_given_back_is_no_growth():
    outcome = FrameOutcome()
    outcome.resident_kib[7] += [100, 900, 9000, 1000, 1500, 6000, 1100, 9500]
    assert outcome.growth_kib == 100


def test_a_frame_is_the_same_whenever_it_is_made(tmp_path, capsys):
    one, two = (hostile_frame(corpus_of(3), 3, 11) for _ in range(2))
    assert one == two
    assert run("--show", 11, "--seed", 3, "--out", tmp_path) == 0
    assert (tmp_path / "frame-11.payload").read_bytes() == one.payload
    assert one.kind in capsys.readouterr().out
