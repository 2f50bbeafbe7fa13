"""Recordings with small limits, and records that are lost where goal or run changes."""

import numpy as np
from recorded_flight import fly, put

from dfvs_core.messages.frame import PixelFormat
from dfvs_core.messages.image import encode_png
from dfvs_service.record.recorder import Recorder
from dfvs_service.settings.record_sections import RecordSection


def recorded(folder, events, **limits):
    """Recorder that took the events, and the folder's greatest size on the way, MB."""
    section = RecordSection(min_free_mb=0.0, **limits)
    recorder = Recorder(folder, "r", section, lambda: 0, print)
    greatest = 0
    for event in events:
        put(recorder, *event)
        greatest = max(greatest, sum(path.stat().st_size for path in folder.iterdir()))
    recorder.close()
    return recorder, greatest * 1e-6


def test_a_goal_larger_than_a_file_is_recorded_with_its_frame_records(tmp_path, rng):
    (header, _), *records = fly(np.random.default_rng(7), 4).events
    goal = encode_png(rng.integers(0, 256, (240, 320, 3)).astype(np.uint8))
    recorder, _ = recorded(tmp_path, [(header, goal), *records], max_file_mb=0.9e-6 * len(goal))
    assert (recorder.counts.records, recorder.counts.dropped) == (4, 0)


def test_a_recording_smaller_than_a_file_keeps_its_size_and_the_newest_records(tmp_path):
    flight = fly(np.random.default_rng(7), 12, PixelFormat.RGB8)  # 3 MB
    recorder, greatest_mb = recorded(tmp_path, flight.events, max_total_mb=1.5)
    assert recorder.counts.files_removed > 0
    assert recorder.counts.records == 12
    assert greatest_mb < 2.0


def test_frame_records_lost_before_a_change_of_goal_are_counted(tmp_path):
    flight, again = (fly(np.random.default_rng(seed), 6, next_goal_at=4) for seed in (7, 8))
    numbers = [getattr(message, "number", None) for message, _ in flight.events]
    rest = flight.events[: numbers.index(2)] + flight.events[numbers.index(3) + 1 :]
    recorder, _ = recorded(tmp_path, rest + again.events)  # a run that lost none follows
    assert recorder.counts.missing == 2
