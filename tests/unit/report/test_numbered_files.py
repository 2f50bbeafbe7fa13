"""Numbered files in the order in which they were written."""

import json
from itertools import permutations
from pathlib import Path

import pytest

from dfvs_service.replay.recording import in_order
from dfvs_service.report.black_box import BlackBoxFlight

FILES = [
    Path("/media/stick/drone1-20260102T101112Z-000.mcap"),
    Path("/media/stick/drone1-20260102T101112Z-000-recovered.mcap"),
    Path("/home/me/drone1-20260102T101112Z-001.mcap"),
    Path("/home/me/drone1-20260102T112233Z-000.mcap"),
]
MANY = [Path(f"r{end}.mcap") for end in ("-998", "-999", "-999-recovered", "-1000", ".2-000")]


@pytest.mark.parametrize("files", [FILES, MANY], ids=["in two folders", "a thousand"])
def test_a_recording_is_read_in_the_order_of_its_names_whatever_folder_they_lie_in(files):
    assert all(in_order(order) == files for order in permutations(files))


def test_the_telemetry_of_a_black_box_is_read_in_order_from_its_thousandth_file_on(tmp_path):
    (tmp_path / "flight.json").write_text('{"started_ns": 0}\n')
    for number in range(997, 1003):
        data = {"t_ns": number * 100_000_000, "t_capture_ns": 0, "error_m": 1.0}
        line = json.dumps({"stream": "servo", "data": data})
        (tmp_path / f"telemetry-{number:03d}.jsonl").write_text(line + "\n")
    times = [t_s for t_s, _ in BlackBoxFlight(tmp_path).read().series.latency_ms]
    assert len(times) == 6
    assert times == sorted(times)
