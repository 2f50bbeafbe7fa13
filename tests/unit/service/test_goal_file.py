import cv2
import numpy as np
import pytest

from dfvs_core.errors import ConfigError, DfvsError, ImageError
from dfvs_core.geometry.camera import CameraModel
from dfvs_core.messages.goal import GoalSidecar, Mount
from dfvs_core.messages.goal_command import GoalCommand
from dfvs_core.messages.image import encode_png
from dfvs_service.settings.goal_file import (
    commanded_goal,
    goal_command,
    load_goal,
    read_image,
    read_sidecar,
)

CAMERA = CameraModel.from_horizontal_fov(64, 48, 1.2)
FLOWN = GoalSidecar(CAMERA, mount=Mount(pitch_rad=0.1))


@pytest.fixture
def picture(tmp_path, rng):
    path = tmp_path / "goal.png"
    cv2.imwrite(str(path), rng.integers(0, 255, (48, 64, 3), dtype=np.uint8))
    return path


def test_a_goal_is_a_picture_in_rgb_with_its_sidecar(picture):
    sidecar = GoalSidecar(CAMERA, roll_rad=0.1)
    picture.with_suffix(".json").write_text(sidecar.to_json())
    goal = load_goal(picture)
    assert goal.sidecar == sidecar
    np.testing.assert_array_equal(goal.image[:, :, ::-1], cv2.imread(str(picture)))


def test_a_picture_may_come_without_a_sidecar(picture):
    assert read_sidecar(picture) is None
    with pytest.raises(ConfigError, match="no sidecar"):
        load_goal(picture)


@pytest.mark.parametrize("content", [b"", b"not a picture", b"\x89PNG\r\n\x1a\n" + b"\0" * 40])
def test_what_is_no_picture_is_refused(tmp_path, content):
    path = tmp_path / "goal.png"
    path.write_bytes(content)
    with pytest.raises(ImageError, match=r"goal\.png"):
        read_image(path)


def test_a_cut_picture_is_refused(picture):
    data = picture.read_bytes()
    picture.write_bytes(data[: len(data) // 2])
    with pytest.raises(ImageError):
        read_image(picture)


@pytest.mark.parametrize("name", ["none.png", "."])
def test_a_picture_that_cannot_be_read_is_an_error(tmp_path, name):
    with pytest.raises(ImageError, match="cannot read"):
        read_image(tmp_path / name)


@pytest.mark.parametrize("text", ["", "{}", '{"camera": 3}', "[1]"])
def test_a_sidecar_that_does_not_follow_the_format_is_refused(picture, text):
    picture.with_suffix(".json").write_text(text)
    with pytest.raises(ConfigError, match=r"goal\.json"):
        read_sidecar(picture)


def test_a_sidecar_that_cannot_be_read_is_an_error(picture):
    picture.with_suffix(".json").mkdir()
    with pytest.raises(ConfigError, match="cannot read"):
        read_sidecar(picture)


def test_a_picture_of_another_size_than_its_camera_is_refused(picture):
    other = GoalSidecar(CameraModel.from_horizontal_fov(640, 480, 1.2))
    picture.with_suffix(".json").write_text(other.to_json())
    with pytest.raises(ImageError, match="640 x 480"):
        load_goal(picture)


def png(width=64, height=48):
    row = np.linspace(0, 255, width).astype(np.uint8)
    return encode_png(np.tile(row[:, None], (height, 1, 3)))


@pytest.mark.parametrize(("level", "told"), [(0, "black"), (255, "white"), (90, "no contrast")])
def test_a_goal_that_cannot_be_matched_is_an_error(picture, level, told):
    picture.write_bytes(encode_png(np.full((48, 64, 3), level, np.uint8)))
    picture.with_suffix(".json").write_text(FLOWN.to_json())
    for load in (load_goal, goal_command):
        with pytest.raises(ImageError, match=rf"goal\.png cannot be matched: the image .*{told}"):
            load(picture)
    with pytest.raises(ImageError, match=f"new goal cannot be matched: .*{told}"):
        commanded_goal(GoalCommand(picture.read_bytes()), FLOWN)


@pytest.mark.parametrize(
    ("sent", "sidecar"),
    [
        ("", FLOWN),
        (GoalSidecar(CAMERA, roll_rad=0.2).to_json(), GoalSidecar(CAMERA, roll_rad=0.2)),
        (
            '{"roll_rad": 0.2, "pitch_rad": -0.1}',
            GoalSidecar(CAMERA, 0.2, -0.1, FLOWN.mount),
        ),
    ],
)
def test_what_a_goals_sidecar_lacks_is_that_of_the_camera_that_flies(sent, sidecar):
    goal = commanded_goal(GoalCommand(png(), sent), FLOWN)
    assert goal.sidecar == sidecar
    assert goal.image.shape == (48, 64, 3)


@pytest.mark.parametrize(
    "order",
    [
        GoalCommand(b"GIF89a"),
        GoalCommand(png(32, 24)),
        GoalCommand(png(), "not JSON"),
        GoalCommand(png(), '{"unknown": 1}'),
        GoalCommand(
            png(32, 24), GoalSidecar(CameraModel.from_horizontal_fov(32, 24, 1.0)).to_json()
        ),
    ],
    ids=["no picture", "another size", "no sidecar", "a wrong sidecar", "another camera's"],
)
def test_what_cannot_be_flown_to_is_an_error(order):
    with pytest.raises(DfvsError):
        commanded_goal(order, FLOWN)


def test_a_new_goal_of_another_lens_is_an_error():
    other = GoalSidecar(CameraModel.from_horizontal_fov(64, 48, 0.9))
    with pytest.raises(ConfigError, match="focal length"):
        commanded_goal(GoalCommand(png(), other.to_json()), FLOWN)


def test_a_picture_is_sent_as_it_is_on_disk(tmp_path):
    path = tmp_path / "b.png"
    path.write_bytes(png())
    assert goal_command(path) == GoalCommand(png())
    path.with_suffix(".json").write_text(FLOWN.to_json())
    assert goal_command(path) == GoalCommand(png(), FLOWN.to_json())
    path.write_bytes(png(32, 24))
    with pytest.raises(DfvsError):
        goal_command(path)
