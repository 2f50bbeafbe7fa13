"""Recordings of which a part is damaged: the rest is read, and the damage is named."""

import numpy as np
import pytest
from recorded_flight import fly, write_recording

from dfvs_core.messages.frame import PixelFormat
from dfvs_core.messages.frame_record import FrameRecord
from dfvs_service.record.cli import main as record_main
from dfvs_service.record.mcap_file import McapFile
from dfvs_service.record.messages import channels
from dfvs_service.record.messages.translation import Translation
from dfvs_service.record.reading import RecordingError
from dfvs_service.replay.comparison import compare
from dfvs_service.replay.flight import Trial, replay
from dfvs_service.replay.recording import read_recording
from dfvs_service.report.recording import RecordedFlight


@pytest.fixture(scope="module")
def flight():
    """Raw pixels: a chunk for every frame."""
    return fly(np.random.default_rng(7), 12, PixelFormat.RGB8, next_goal_at=6)


@pytest.fixture
def recording(flight, tmp_path):
    return write_recording(tmp_path, flight.events)


def flip_a_bit(path, at):
    data = bytearray(path.read_bytes())
    data[at] ^= 0x40
    path.write_bytes(data)


def records(path, warnings):
    entries = [entry.message for entry in read_recording([path], warnings.append)]
    return [message for message in entries if isinstance(message, FrameRecord)]


def test_a_damaged_chunk_is_left_out_and_named_by_every_tool(flight, recording, capsys):
    flip_a_bit(recording, recording.stat().st_size // 4)
    warning = "flight-000.mcap: damaged chunks left out: 1"
    kept = records(recording, warnings := [])
    assert warnings == [warning]
    assert len(flight.turns) - 3 <= len(kept) < len(flight.turns)
    assert kept[-1] == flight.turns[-1]
    assert replay([recording], Trial(), lambda _: None).warnings == (warning,)
    assert RecordedFlight([recording]).read().summary.told == (f"warning: {warning}",)
    assert record_main(["recover", str(recording)]) == 0
    assert f"warning: {warning}" in capsys.readouterr().err
    assert records(recording.with_stem("flight-000-recovered"), []) == kept


def test_a_file_that_ends_early_is_read_as_far_as_it_goes_and_named_by_every_tool(
    flight, recording
):
    data = recording.read_bytes()
    recording.write_bytes(data[: len(data) // 2])
    kept = records(recording, warnings := [])
    assert warnings == ["flight-000.mcap ends early: it was cut off, or is damaged there"]
    replayed = replay([recording], Trial(), lambda _: None)
    assert replayed.warnings == tuple(warnings)
    assert compare(replayed.frames).is_identical
    part = RecordedFlight([recording]).read()
    assert 2 < len(kept) == len(part.series.error_m) < len(flight.turns) - 1
    assert part.summary.verdict == "the recording ends in SERVO: tested"


def test_records_whose_session_header_is_damaged_are_left_out_and_counted(flight, recording):
    """Nobody knows which goal they are about."""
    _, image = next(event for event in flight.events[1:] if event[0] not in flight.turns)
    # The image lies in the header's chunk, and no compression changes its bytes.
    flip_a_bit(recording, recording.read_bytes().index(image[1000:1032]))
    kept = records(recording, warnings := [])
    assert kept == flight.turns[: len(kept)]
    assert 3 < len(kept) <= 6
    assert "flight-000.mcap: frame records without their session header left out: 6" in warnings


@pytest.mark.parametrize("lost", [3, -1])
def test_a_frame_record_whose_image_was_lost_is_left_out_wherever_it_lies(tmp_path, lost):
    flight = fly(np.random.default_rng(7), 6)
    (header, goal), *frames = flight.events
    translation = Translation(header)
    file = McapFile(tmp_path / "flight-000.mcap", {})
    file.write(translation.header(goal))
    for record, payload in frames:
        messages = list(translation.record(record, payload))
        if record is frames[lost][0]:
            messages = [m for m in messages if m.channel is not channels.COMPRESSED_IMAGE]
        file.write(messages)
    file.finish()
    kept = [record for record in flight.turns if record is not frames[lost][0]]
    assert records(file.path, []) == kept


@pytest.mark.parametrize("content", [b"", b"\x89MCAP0\r\n", bytes(4096)])
def test_a_file_that_a_power_cut_left_empty_is_left_out_and_named(content, flight, recording):
    empty = recording.with_name("flight-001.mcap")
    empty.write_bytes(content)
    source = RecordedFlight([recording, empty])
    assert len(source.read().series.error_m) == len(flight.turns)
    assert source.read().summary.told == (f"warning: {empty} is not a recording: left out",)
    assert replay([recording, empty], Trial(), lambda _: None).frames


def test_a_recording_whose_only_session_header_is_damaged_is_refused_for_it(tmp_path):
    path = write_recording(tmp_path, fly(np.random.default_rng(7), 3).events)
    flip_a_bit(path, path.read_bytes().index(b"first_turn"))
    with pytest.raises(RecordingError, match="or its session header is damaged"):
        records(path, [])
