"""A recording whose display fails, as a terminal does once its connection is lost."""

import dataclasses

import numpy as np
import pytest
from mcap.reader import make_reader

from dfvs_core.geometry.camera import CameraModel
from dfvs_core.messages.goal import Goal, GoalSidecar
from dfvs_core.messages.image import encode_png
from dfvs_service.perception import recorder as perception_recorder
from dfvs_service.perception.frame_processor import unhealthy_report
from dfvs_service.perception.recorder import FrameRecorder
from dfvs_service.record.process import record
from dfvs_service.settings.config import load_config

IMAGE = np.zeros((72, 96, 3), np.uint8)
GOAL = Goal(IMAGE, GoalSidecar(CameraModel.from_horizontal_fov(96, 72, 1.3)))


class OneFrame:
    """Follower of a service that publishes its header and a frame record, again and again."""

    dropped = 0

    def __init__(self):
        frames = FrameRecorder(load_config(None, {}), b"clock")
        self._header = (frames.open(GOAL), encode_png(IMAGE))
        self._record = frames.without_sample(0, (), unhealthy_report(0, 0, "no frame"))

    def events(self):
        yield [self._header]
        for number in range(100):
            yield [(dataclasses.replace(self._record, number=number), b"")]


def test_what_was_recorded_has_its_index(tmp_path, monkeypatch):
    def show(recorder):
        if recorder.counts.records == 10:
            raise OSError("Input/output error")

    monkeypatch.setattr(perception_recorder, "perception_files", lambda config: {})
    config = load_config(None, {"record.min_free_mb": 0})
    with pytest.raises(OSError, match="Input/output"):
        record(config, tmp_path, OneFrame(), show)
    (path,) = tmp_path.glob("*.mcap")
    with path.open("rb") as file:
        summary = make_reader(file).get_summary()
    topics = {channel.id: channel.topic for channel in summary.channels.values()}
    counts = summary.statistics.channel_message_counts
    assert {topics[i]: count for i, count in counts.items()}["/dfvs/turn"] == 10
