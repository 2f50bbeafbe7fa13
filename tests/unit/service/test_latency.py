import pytest

from dfvs_service.perception.telemetry.messages import WINDOW, LatencyWindow


def test_percentiles_of_each_stage_in_ms():
    window = LatencyWindow()
    for k in range(101):
        window.add({"match": k * 1_000_000, "decode": 2_000_000})
    summary = window.summary()
    assert summary["match"] == {"p50_ms": 50.0, "p99_ms": 99.0, "max_ms": 100.0}
    assert summary["decode"]["p99_ms"] == pytest.approx(2.0)


def test_only_recent_frames_count():
    window = LatencyWindow()
    window.add({"match": 10**9})
    for _ in range(WINDOW):
        window.add({"match": 10**6})
    assert window.summary()["match"]["max_ms"] == pytest.approx(1.0)
