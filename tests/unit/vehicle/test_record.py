"""The vehicle's record on disk."""

from pathlib import Path

import pytest

from dfvs_core.errors import ConfigError
from dfvs_sim.vehicle.record import VehicleRecord, read_record


def test_each_event_is_readable_before_the_file_is_closed(tmp_path: Path) -> None:
    path = tmp_path / "vehicle.jsonl"
    record = VehicleRecord(path)
    record(5, "setpoint", {"velocity": [1.0, 0.0, 0.0]})
    events = list(read_record(path))
    record.close()
    assert events == [{"t_ns": 5, "kind": "setpoint", "velocity": [1.0, 0.0, 0.0]}]


def test_a_torn_last_line_is_left_out(tmp_path: Path) -> None:
    path = tmp_path / "vehicle.jsonl"
    path.write_text('{"t_ns": 1, "kind": "pose"}\n{"t_ns": 2, "ki')
    assert [event["t_ns"] for event in read_record(path)] == [1]


def test_a_record_that_cannot_be_written_is_an_error_with_its_name(tmp_path: Path) -> None:
    with pytest.raises(ConfigError, match="no-such-folder"):
        VehicleRecord(tmp_path / "no-such-folder" / "vehicle.jsonl")
