"""Files that are numbered beyond 999."""

import json
from itertools import permutations
from pathlib import Path

from dfvs_service.replay.recording import in_order
from dfvs_service.report.black_box import BlackBoxFlight

NAMES = ("r-998", "r-999", "r-999-recovered", "r-1000", "r.2-000")


def test_a_recording_is_read_in_order_from_its_thousandth_file_on():
    paths = [Path(f"{name}.mcap") for name in NAMES]
    assert all(in_order(order) == paths for order in permutations(paths))


def test_the_telemetry_of_a_black_box_is_read_in_order_from_its_thousandth_file_on(tmp_path):
    (tmp_path / "flight.json").write_text('{"started_ns": 0}\n')
    for number in range(997, 1003):
        data = {"t_ns": number * 100_000_000, "t_capture_ns": 0, "error_m": 1.0}
        line = json.dumps({"stream": "servo", "data": data})
        (tmp_path / f"telemetry-{number:03d}.jsonl").write_text(line + "\n")
    times = [t_s for t_s, _ in BlackBoxFlight(tmp_path).read().series.latency_ms]
    assert len(times) == 6
    assert times == sorted(times)
