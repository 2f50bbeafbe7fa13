"""Session headers and frame records of a process."""

import numpy as np

from dfvs_core.geometry.camera import CameraModel
from dfvs_core.messages.goal import Goal, GoalSidecar
from dfvs_service.perception import recorder as module
from dfvs_service.perception.frame_processor import unhealthy_report
from dfvs_service.perception.recorder import FrameRecorder
from dfvs_service.settings.config import load_config

CAMERA = CameraModel.from_horizontal_fov(96, 72, 1.3)
GOAL = Goal(np.zeros((72, 96, 3), np.uint8), GoalSidecar(CAMERA))


def test_code_and_models_are_hashed_once_and_never_at_a_change_of_goal(monkeypatch):
    hashed = []
    monkeypatch.setattr(
        module, "perception_files", lambda config: hashed.append(config) or {"a": "b"}
    )
    recorder = FrameRecorder(load_config(None, {}), b"clock")
    first = recorder.open(GOAL)
    record = recorder.without_sample(0, (), unhealthy_report(0, 0, "no frame"))
    second = recorder.open(GOAL, 12)
    assert len(hashed) == 1
    assert first.model == second.model == {"a": "b"}
    assert (record.number, record.opening) == (0, first.opened_ns)
    assert (first.first_turn, second.first_turn, second.observed_ns) == (0, 1, 12)
    assert second.opened_ns >= first.opened_ns


def test_unix_times_of_all_goals_of_a_process_have_one_offset_whatever_the_clock_does(monkeypatch):
    monkeypatch.setattr(module, "perception_files", lambda config: {})
    ticks = iter((0, 5_000_000_000, 9_000_000_000))  # the Unix clock falls back as far
    recorder = FrameRecorder(load_config(None, {}), b"clock", lambda: next(ticks))
    first, second = recorder.open(GOAL), recorder.open(GOAL)
    assert (first.opened_ns, second.opened_ns) == (5_000_000_000, 9_000_000_000)
    assert first.unix_offset_ns == second.unix_offset_ns
