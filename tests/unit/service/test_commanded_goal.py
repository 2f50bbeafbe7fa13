import numpy as np
import pytest

from dfvs_core.errors import DfvsError
from dfvs_core.geometry.camera import CameraModel
from dfvs_core.messages.goal import GoalSidecar, Mount
from dfvs_core.messages.goal_command import GoalCommand
from dfvs_core.messages.image import encode_png
from dfvs_service.settings.goal_file import commanded_goal, goal_command

CAMERA = CameraModel.from_horizontal_fov(64, 48, 1.0)
FLOWN = GoalSidecar(CAMERA, mount=Mount(pitch_rad=0.1))


def picture(width=64, height=48):
    return encode_png(np.zeros((height, width, 3), np.uint8))


def test_a_goal_without_a_sidecar_counts_as_taken_by_the_camera_that_flies():
    goal = commanded_goal(GoalCommand(picture()), FLOWN)
    assert goal.sidecar == FLOWN
    assert goal.image.shape == (48, 64, 3)


def test_a_goals_own_sidecar_counts():
    own = GoalSidecar(CAMERA, roll_rad=0.2)
    assert commanded_goal(GoalCommand(picture(), own.to_json()), FLOWN).sidecar == own


def test_a_sidecar_without_a_camera_is_of_the_camera_that_flies():
    goal = commanded_goal(GoalCommand(picture(), '{"roll_rad": 0.2, "pitch_rad": -0.1}'), FLOWN)
    assert goal.sidecar == GoalSidecar(CAMERA, 0.2, -0.1, FLOWN.mount)


@pytest.mark.parametrize(
    "order",
    [
        GoalCommand(b"GIF89a"),
        GoalCommand(picture(32, 24)),
        GoalCommand(picture(), "not JSON"),
        GoalCommand(picture(), '{"unknown": 1}'),
        GoalCommand(
            picture(32, 24), GoalSidecar(CameraModel.from_horizontal_fov(32, 24, 1.0)).to_json()
        ),
    ],
    ids=["no picture", "another size", "no sidecar", "a wrong sidecar", "another camera's"],
)
def test_what_cannot_be_flown_to_is_an_error(order):
    with pytest.raises(DfvsError):
        commanded_goal(order, FLOWN)


def test_a_picture_is_sent_as_it_is_on_disk(tmp_path):
    path = tmp_path / "b.png"
    path.write_bytes(picture())
    assert goal_command(path) == GoalCommand(picture())
    path.with_suffix(".json").write_text(FLOWN.to_json())
    assert goal_command(path) == GoalCommand(picture(), FLOWN.to_json())
    path.write_bytes(picture(32, 24))
    with pytest.raises(DfvsError):
        goal_command(path)
