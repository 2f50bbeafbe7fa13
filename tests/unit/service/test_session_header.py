"""Session headers of a process."""

import numpy as np

from dfvs_core.geometry.camera import CameraModel
from dfvs_core.messages.goal import Goal, GoalSidecar
from dfvs_service.perception import session_header
from dfvs_service.perception.session_header import SessionHeaders
from dfvs_service.settings.config import load_config

CAMERA = CameraModel.from_horizontal_fov(96, 72, 1.3)


def test_code_and_models_are_hashed_once_and_never_at_a_change_of_goal(monkeypatch):
    hashed = []
    monkeypatch.setattr(
        session_header, "perception_files", lambda config: hashed.append(config) or {"a": "b"}
    )
    sidecar = GoalSidecar(CAMERA)
    headers = SessionHeaders(load_config(None, {}), b"clock")
    goal = Goal(np.zeros((72, 96, 3), np.uint8), sidecar)
    first, second = headers.make(goal), headers.make(goal, 7, 12)
    assert len(hashed) == 1
    assert first.model == second.model == {"a": "b"}
    assert (first.first_turn, second.first_turn, second.observed_ns) == (0, 7, 12)
    assert second.opened_ns >= first.opened_ns
