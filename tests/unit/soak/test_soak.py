import json
import mmap
import os
from dataclasses import replace

import numpy as np
import psutil
import pytest

from dfvs_robustness.commands import soak
from dfvs_robustness.soak.holds import Hold, explain
from dfvs_robustness.soak.mission import Leg
from dfvs_robustness.soak.plots import write_plots
from dfvs_robustness.soak.sampling import Sample, Sampler, own_memory_mb, role_of
from dfvs_robustness.soak.verdict import judge, latency_figures, robust_slope

MS = 1_000_000
T_H = np.linspace(0.0, 0.5, 900)
PAIR = ("gate", "perception")


def test_a_slope_is_found_beneath_noise_and_steps_of_the_allocator(rng):
    y = 200.0 + 3.0 * T_H + rng.normal(0.0, 0.2, len(T_H))
    y[::50] += 40.0  # a short spike now and then
    slope = robust_slope(T_H, y)
    assert slope.value == pytest.approx(3.0, abs=0.4)
    assert slope.low < 3.0 < slope.high
    assert slope.high - slope.low < 2.0


def test_an_interval_holds_the_true_slope_as_often_as_it_says(rng):
    hits = 0
    for _ in range(200):
        slope = robust_slope(T_H, rng.normal(0.0, 1.0, len(T_H)))
        hits += slope.low <= 0.0 <= slope.high
    # 95 % of 200, and three standard deviations less.
    assert hits >= 180


def test_a_constant_has_no_slope():
    slope = robust_slope(T_H, np.full(len(T_H), 7.0))
    assert (slope.low, slope.value, slope.high) == (0.0, 0.0, 0.0)


def test_too_few_samples_give_no_slope():
    with pytest.raises(ValueError, match="4 needed"):
        robust_slope(np.array([0.0, 1.0, 2.0]), np.zeros(3))


def samples(
    mb_per_h=0.0, descriptors=lambda t_s: 20, threads=lambda t_s: 5, noise=0.05, roles=PAIR
):
    rng = np.random.default_rng(1)
    return [
        Sample(
            t_s=t_s,
            role=role,
            pid=pid,
            rss_mb=120.0,
            own_mb=100.0 + mb_per_h * t_s / 3600.0 + rng.normal(0.0, noise),
            descriptors=descriptors(t_s),
            threads=threads(t_s),
            cpu_percent=1.0,
            latency_p50_ms=50.0 + t_s / 100.0 if role == "perception" else None,
            latency_p99_ms=90.0 if role == "perception" else None,
        )
        for t_s in np.arange(0.0, 1800.0, 10.0).tolist()
        for pid, role in enumerate(roles)
    ]


@pytest.mark.parametrize(
    ("mb_per_h", "noise", "memory"),
    [(0.0, 0.05, "passed"), (3.0, 0.05, "failed"), (0.8, 2.0, "undecided")],
)
def test_memory_is_judged_by_the_interval_and_not_by_luck(mb_per_h, noise, memory):
    assert [v.memory for v in judge(samples(mb_per_h, noise=noise))] == [memory] * 2


def test_two_processes_of_one_role_are_judged_each_by_itself():
    growing = [replace(s, own_mb=s.own_mb + s.t_s / 1200.0) if s.pid else s for s in samples()]
    verdicts = judge([replace(s, role="parent") for s in growing])
    assert [(v.pid, v.memory) for v in verdicts] == [(0, "passed"), (1, "failed")]


def test_the_warm_up_does_not_count():
    warming = [s if s.t_s > 290 else replace(s, own_mb=s.t_s / 3.0) for s in samples()]
    assert all(v.passed for v in judge(warming))


@pytest.mark.parametrize("what", ["descriptors", "threads"])
def test_one_more_for_good_is_growth_and_a_short_one_is_not(what):
    (grown, _) = judge(samples(**{what: lambda t_s: 20 + (t_s > 1000)}))
    assert not grown.passed
    assert getattr(grown, f"{what}_grown") == 1
    (brief, _) = judge(samples(**{what: lambda t_s: 20 + (1000 < t_s < 1100)}))
    assert brief.passed


def test_latency_is_told_for_the_beginning_and_the_end():
    assert latency_figures(samples())["first_p50"] < latency_figures(samples())["last_p50"]
    assert latency_figures([])["last_p99"] is None


def test_processes_are_known_by_their_module():
    assert role_of(["python", "-m", "dfvs_service.gate", "--runtime", "x"]) == "gate"
    assert role_of(["python", "-m", "dfvs_service.perception"]) == "perception"
    assert role_of(["python", "-m", "dfvs_service.flights", "--runtime", "x"]) == "black box"
    assert role_of(["python", "-m", "dfvs_service.record", "--runtime", "x"]) == "recorder"
    assert role_of(["python", "-m", "dfvs_service.cli", "--goal", "gate.png"]) == "parent"


def test_a_sample_tells_what_a_process_holds(tmp_path):
    sampler = Sampler(os.getpid(), lambda: (1.0, 2.0))
    sampler.sample()
    with (tmp_path / "open").open("w"):
        sampler.sample()
    first, second = (s for s in sampler.samples if s.pid == os.getpid())
    assert second.descriptors == first.descriptors + 1
    assert 0 < first.own_mb <= first.rss_mb
    assert first.threads >= 1


def test_own_memory_is_what_a_process_fills_and_no_page_of_a_file(tmp_path):
    (tmp_path / "file").write_bytes(bytes(40_000_000))
    before_mb = own_memory_mb(os.getpid())
    # A map of its own: an array might lie in memory that an earlier test filled and freed.
    with mmap.mmap(-1, 40_000_000, flags=mmap.MAP_PRIVATE | mmap.MAP_ANONYMOUS) as filled:
        for _ in range(40):
            filled.write(b"x" * 1_000_000)
        read = np.memmap(tmp_path / "file", np.uint8, "r")
        assert read.sum() == 0
        assert own_memory_mb(os.getpid()) - before_mb == pytest.approx(40.0, abs=4.0)
    with pytest.raises(psutil.NoSuchProcess):
        own_memory_mb(2**22)


class FlownTour:
    """What a tour leaves behind."""

    def __init__(self, folder, holds=(), state="DONE", mb_per_h=0.0):
        self.folder = folder
        self.legs = [Leg(1, state, "", 12.0, 0.01, 0.002)]
        self.sampler = Sampler(os.getpid(), lambda: None)
        self.sampler.samples = samples(mb_per_h)
        self.holds = holds


@pytest.mark.parametrize(
    ("changes", "verdict"),
    [
        ({}, "passed"),
        ({"holds": [Hold("result too late", 70.0, 90.0, 300.0)]}, "failed"),
        ({"holds": [Hold("last good frame too old", 240.0, 240.0, 60.0)]}, "passed"),
        ({"state": "ABORT"}, "failed"),
        ({"mb_per_h": 5.0}, "failed"),
    ],
)
def test_a_soak_passes_only_if_all_is_well(tmp_path, changes, verdict):
    report = soak.figures(FlownTour(tmp_path, **changes), 30.0, "")
    assert report["verdict"] == verdict
    assert json.loads(json.dumps(report)) == report
    assert (tmp_path / "soak.png").stat().st_size > 10_000


def test_a_soak_that_ended_early_does_not_pass(tmp_path):
    assert soak.figures(FlownTour(tmp_path), 30.0, "the service ended")["verdict"] == "failed"


def test_plots_are_drawn_of_few_samples(tmp_path):
    write_plots(samples()[:3], tmp_path / "few.png")
    assert (tmp_path / "few.png").exists()


def test_every_process_is_drawn(tmp_path):
    roles = ("parent", "gate", "perception", "operator link", "black box", "recorder")
    write_plots(samples(roles=roles), tmp_path / "soak.svg")
    drawn = (tmp_path / "soak.svg").read_text()  # labels are comments there
    assert [role for role in roles if f"<!-- {role}, from" not in drawn] == []


def servo(t_ms, latency_ms):
    return {"t_capture_ns": t_ms * MS, "stages_ms": {"capture_to_report": latency_ms}}


def test_a_hold_is_explained_by_what_happened_just_before_it():
    sent = [t * MS for t in (100, 900, 2000, 2066, 2300, 2366, 2500)]
    seen = [servo(900, 500.0), servo(2000, 50.0), servo(2300, 180.5), servo(2800, 10.0)]
    hold = explain(2550 * MS, "last good frame too old 250 ms", sent, seen)
    assert hold == Hold("last good frame too old 250 ms", 234.0, 250.0, 180.5)
    assert not hold.is_false


def test_a_camera_that_stopped_makes_no_hold_false():
    silent = explain(2550 * MS, "last good frame too old", [2100 * MS], [])
    assert (silent.camera_gap_ms, silent.is_false) == (450.0, False)
    assert explain(2550 * MS, "late", [], []).camera_gap_ms == 500.0
    sent = range(2000 * MS, 2550 * MS, 66 * MS)
    assert explain(2550 * MS, "late", sent, []).is_false
