"""Writing of a goal's two files."""

import numpy as np
import pytest
from full_disk import no_file_above

from dfvs_common.goal_file import write_goal
from dfvs_core.errors import ConfigError
from dfvs_core.geometry.camera import CameraModel
from dfvs_core.messages.goal import GoalSidecar

CAMERA = CameraModel.from_horizontal_fov(64, 48, 1.2)


def test_a_goal_that_the_disk_has_no_room_for_leaves_the_old_one_whole(tmp_path):
    image = np.random.default_rng(0).integers(0, 256, (48, 64, 3), np.uint8)
    path = tmp_path / "goal.png"
    write_goal(path, image, GoalSidecar(CAMERA))
    before = {file.name: file.read_bytes() for file in tmp_path.iterdir()}
    refusal = pytest.raises(ConfigError, match=r"goal\.png cannot be written")
    with no_file_above(4_000), refusal:  # the sidecar fits
        write_goal(path, image[::-1], GoalSidecar(CAMERA, pitch_rad=-0.2))
    assert {file.name: file.read_bytes() for file in tmp_path.iterdir()} == before
