"""What the demo refuses, and its cameras, as far as they are words."""

import pytest

from dfvs_core.geometry.camera import CameraModel
from dfvs_core.messages.frame import PixelFormat
from dfvs_service.ros2.frame_source import Ros2FrameSource
from dfvs_service.settings.config import load_config, parse_assignment
from dfvs_sim.demo.cli import main
from dfvs_sim.demo.flight.camera_link import CAMERAS, camera_link

CAMERA = CameraModel.from_horizontal_fov(320, 240, 1.3)


@pytest.mark.parametrize(
    ("words", "message"),
    [
        (("--start", "1,2,3"), "--start is '1,2,3'"),
        (("--goal", "0,0,-1.3,0"), "--start is missing"),
        (("--scene", "nowhere.glb"), "nowhere.glb"),
        (("--size", "big"), "--size is 'big'"),
        (("--fov", "200"), "field of view"),
        (("--runs", "0"), "--runs is 0"),
        (("--json", "/nowhere/at/all.json"), "--json"),
        (("--json", "."), "--json . is a folder"),
        (("--seed", "-1"), "--seed is -1"),
        (("--rate", "0"), "--rate is 0"),
        (("--timeout", "0"), "--timeout is 0"),
        (("--ready", "0"), "--ready is 0"),
        (("--name", "A B"), "vehicle name 'A B'"),
        (("--autopilot", "/dev/ttyACM0"), "--autopilot is '/dev/ttyACM0'; expected a MAVLink URL"),
        (("--autopilot", "serial:///dev/ttyACM0"), "vehicle.mavlink = 'serial:///dev/ttyACM0'"),
        (("--autopilot", "udpin://127.0.0.1:1", "--ground", "14550"), "--ground is '14550'"),
        (("--vehicles", "5"), "--vehicles is 5; expected 1 to 4"),
        (("--vehicles", "0"), "--vehicles is 0; expected 1 to 4"),
        (("--vehicles", "-1"), "--vehicles is -1; expected 1 to 4"),
        (("--vehicles", "2", "--runs", "2"), "--runs beside --vehicles"),
        (("--vehicles", "2", "--autopilot", "udpin://127.0.0.1:1"), "--autopilot beside"),
        (("--system-id", "251"), "--system-id is 251"),
        (("--vehicles", "3", "--system-id", "249"), "--system-id is 249; expected 1 to 248"),
        (("--ground", "udpin://127.0.0.1:1"), "--ground without --autopilot"),
        (("--estimate", "exact"), "--estimate is 'exact'"),
        (("--wind", "gale"), "--wind is 'gale'"),
        (("--estimate", "low", "--autopilot", "udpin://127.0.0.1:1"), "--estimate beside"),
        (("--wind", "calm", "--autopilot", "udpin://127.0.0.1:1"), "--wind beside --autopilot"),
        (("--service", "--engage never"), "engage never"),
        (("--service", "--enagge auto"), "its words: unrecognized arguments: --enagge auto"),
        (("--service", "--set gate.engaged=auto"), "did you mean 'engage'"),
        (("--route", "--goal", "0,0,-1,0"), "--route beside"),
        (("--route", "--start", "0,0,-1,0"), "--route beside"),
        (("--route", "--scene", "room.glb"), "--route beside"),
    ],
)
def test_bad_words_are_one_clear_line(tmp_path, refused, words, message):
    assert message in refused(main, "--out", tmp_path / "out", *words)
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
    intake = Ros2FrameSource(link.ros2.link, config.camera.ros2, b"c" * 16)
    assert intake.key == link.ros2.image.key(link.ros2.link)
    assert intake.calibration_key == link.ros2.info.key(link.ros2.link)
