"""A recorder on a disk that has no room."""

import dataclasses
from types import SimpleNamespace

import numpy as np
import pytest
from full_disk import no_file_above

from dfvs_core.geometry.camera import CameraModel
from dfvs_core.messages.goal import Goal, GoalSidecar
from dfvs_core.messages.image import encode_png
from dfvs_service.perception import recorder as perception_recorder
from dfvs_service.perception.frame_processor import unhealthy_report
from dfvs_service.perception.recorder import FrameRecorder
from dfvs_service.record import recorder as module
from dfvs_service.record.recorder import Recorder
from dfvs_service.settings.config import load_config
from dfvs_service.settings.record_sections import RecordSection

S = 1_000_000_000
IMAGE = np.zeros((72, 96, 3), np.uint8)
GOAL = Goal(IMAGE, GoalSidecar(CameraModel.from_horizontal_fov(96, 72, 1.3)))


class Desk:
    """A recorder that is given a frame record a second."""

    def __init__(self, folder):
        frames = FrameRecorder(load_config(None, {}), b"clock")
        self.now_ns = 0
        self.warnings = []
        section = RecordSection(min_free_mb=0.1)
        self.recorder = Recorder(folder, "r", section, lambda: self.now_ns, self.warnings.append)
        self.recorder.open(frames.open(GOAL), encode_png(IMAGE))
        self._record = frames.without_sample(0, (), unhealthy_report(0, 0, "no frame"))

    def wait(self, seconds):
        for _ in range(seconds):
            self.now_ns += S
            self.recorder.add(dataclasses.replace(self._record, number=self.now_ns // S), b"")


@pytest.fixture
def desk(tmp_path, monkeypatch):
    monkeypatch.setattr(perception_recorder, "perception_files", lambda config: {})
    return Desk(tmp_path)


def test_a_pause_is_told_once_and_the_next_one_again(desk, monkeypatch):
    free = [10**9]
    monkeypatch.setattr(module.shutil, "disk_usage", lambda _: SimpleNamespace(free=free[0]))
    for free[0] in (0, 10**9, 0):
        desk.wait(300)
    first, second = desk.warnings
    assert first == second
    assert "are free" in first


def test_files_that_stay_empty_are_removed(desk, tmp_path):
    with no_file_above(0):
        desk.wait(60)
    assert list(tmp_path.iterdir()) == []
    assert len(desk.warnings) == 1
    desk.wait(10)
    assert [path.name for path in tmp_path.iterdir()] == ["r-000.mcap"]
