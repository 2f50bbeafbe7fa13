"""Routes and cameras of the demo, as far as they are words."""

import pytest

from dfvs_core.camera import CameraModel
from dfvs_core.wire.frame import PixelFormat
from dfvs_service.config import load_config, parse_assignment
from dfvs_service.ros2.intake import Ros2Intake
from dfvs_sim.demo.cameras import CAMERAS, camera_link
from dfvs_sim.demo.cli import main

CAMERA = CameraModel.from_horizontal_fov(320, 240, 1.3)


@pytest.mark.parametrize(
    "words", [["--goal", "0,0,-1,0"], ["--start", "0,0,-1,0"], ["--scene", "room.glb"]]
)
def test_the_route_brings_its_own_rooms_start_and_goals(words, capsys, tmp_path):
    assert main(["--route", *words, "--out", str(tmp_path / "out")]) == 2
    assert "--route beside" in capsys.readouterr().err
    assert not (tmp_path / "out").exists()


def test_our_own_frames_need_no_further_words():
    link = camera_link(CAMERAS[0], "demo", CAMERA)
    assert link.service_words == ()
    assert link.pixel_format is PixelFormat.JPEG


@pytest.mark.parametrize("name", CAMERAS[1:])
def test_the_service_is_told_where_the_ros_2_driver_publishes(name):
    link = camera_link(name, "demo", CAMERA)
    words = [word for word in link.service_words if word != "--set"]
    config = load_config(None, dict(parse_assignment(word) for word in words))
    assert config.camera.source == name
    intake = Ros2Intake(link.ros2.link, config.camera.ros2, b"c" * 16)
    assert intake.key == link.ros2.image.key(link.ros2.link)
    assert intake.calibration_key == link.ros2.info.key(link.ros2.link)
