"""A camera that tells its calibration to a service that does not know it."""

import json
import threading
import time
from dataclasses import replace

import numpy as np
import pytest
from loopback import peer
from ros2_samples import info_message
from test_camera_process import CAMERA, TOPICS

from dfvs_common.goal_file import write_goal
from dfvs_core.errors import ConfigError, WireError
from dfvs_core.messages.goal import Goal, GoalSidecar
from dfvs_core.messages.ros2 import CAMERA_INFO, Ros2Topic
from dfvs_core.messages.schema import to_json
from dfvs_service.camera.publisher import FramePublisher, PublishOptions
from dfvs_service.flight_setup import resolve
from dfvs_service.frames import CapturedImage
from dfvs_service.perception.announced import CameraDoubts, await_camera
from dfvs_service.perception.frame_source import DfvsFrameSource
from dfvs_service.preflight.calibration import camera_check
from dfvs_service.preflight.stream import stream_checks
from dfvs_service.route.frame_queue import known_camera
from dfvs_service.settings.config import load_config
from dfvs_service.zenoh_session import publish_kept


@pytest.fixture
def endpoint(tmp_path):
    return f"unixsock-stream/{tmp_path}/z"


def config(endpoint, **camera):
    overrides = {f"camera.{key}": value for key, value in camera.items()}
    vehicle = {"vehicle.name": TOPICS.vehicle, "zenoh.listen": [endpoint]}
    return load_config(None, {**vehicle, "camera.announced_s": 5.0, **overrides})


@pytest.fixture
def session(endpoint):
    """Peer that connects as soon as the service listens."""
    with peer(connect=(endpoint,)) as made:
        yield made


def test_a_calibration_announced_long_before_is_still_heard(endpoint, session):
    publisher = FramePublisher(session, PublishOptions(TOPICS.vehicle, camera=CAMERA))
    assert await_camera(config(endpoint)) == CAMERA
    assert publisher.count == 0


def test_an_announcement_above_64_kib_is_not_read(endpoint, session):
    publisher = publish_kept(session, TOPICS.calibration)
    publisher.put(to_json(CAMERA).ljust(70_000))
    with pytest.raises(WireError, match="calibration of 70000 bytes; expected at most 65536"):
        await_camera(config(endpoint))


def test_keys_that_are_not_known_are_ignored():
    announced = json.dumps({**json.loads(to_json(CAMERA)), "name": "nose"}).encode()
    assert DfvsFrameSource(TOPICS).camera(announced) == CAMERA


def test_silence_is_none(endpoint):
    assert await_camera(config(endpoint, announced_s=0.2)) is None
    assert await_camera(config(endpoint, announced_s=0.0)) is None


def test_where_announcements_were_awaited_silence_is_what_is_said(endpoint):
    silent = config(endpoint, announced_s=0.2)
    with pytest.raises(ConfigError, match=r"no camera announced .* within 0\.2 s"):
        known_camera(silent)


def test_the_announced_camera_flies_and_a_goal_of_another_one_is_refused(
    endpoint, session, tmp_path, rng
):
    announced = replace(CAMERA, fx=1.4 * CAMERA.fx)
    _publisher = FramePublisher(session, PublishOptions(TOPICS.vehicle, camera=announced))
    image = rng.integers(0, 255, (CAMERA.height, CAMERA.width, 3), np.uint8)
    write_goal(tmp_path / "goal.png", image, GoalSidecar(CAMERA))
    flown, goal = resolve(config(endpoint), tmp_path / "goal.png")
    assert flown.camera.model() == announced
    assert camera_check(flown, goal).refuses


@pytest.mark.parametrize(
    ("change", "word"),
    [
        ({"width": 80}, "size is 80 x 48 px, here it is 64 x 48"),
        ({"fy": 60.0}, "vertical focal length is 60.0 px"),
        ({"cx": 40.0}, "principal point's x is 40.0 px"),
        ({"distortion": (-0.6, 0.2, 0.0, 0.0)}, "distortion"),
    ],
)
def test_another_announced_camera_is_warned_about_once(capsys, change, word):
    doubts = CameraDoubts(CAMERA)
    for camera in (CAMERA, *2 * [replace(CAMERA, **change)]):
        doubts.on_camera(camera)
    (line,) = capsys.readouterr().err.splitlines()
    assert line.startswith("warning: the announced ")
    assert word in line


def test_the_check_warns_of_another_announced_camera(endpoint, session):
    announced = replace(CAMERA, fx=1.4 * CAMERA.fx)
    publisher = FramePublisher(session, PublishOptions(TOPICS.vehicle, camera=announced))
    goal = Goal(np.zeros((CAMERA.height, CAMERA.width, 3), np.uint8), GoalSidecar(CAMERA))
    stop = threading.Event()

    def work():
        while not stop.wait(0.05):
            publisher.publish(CapturedImage(goal.image, time.monotonic_ns()))

    thread = threading.Thread(target=work)
    thread.start()
    try:
        stream, doubt = stream_checks(config(endpoint), goal)
    finally:
        stop.set()
        thread.join()
    assert stream.ok
    assert "the announced focal length is 70.0 px, here it is 50.0" in doubt.detail
    assert not doubt.ok
    assert not doubt.refuses


def ros2_driver(session, endpoint, info):
    """Publishes CameraInfo with every frame, as drivers do, until somebody has heard it."""
    stop = threading.Event()
    key = Ros2Topic("nose/camera_info", CAMERA_INFO).key("bridge")

    def work():
        while not stop.wait(0.05):
            session.put(key, info)

    threading.Thread(target=work, daemon=True).start()
    names = {"source": "ros2-bridge", "ros2.topic": "nose/image_raw"}
    try:
        return await_camera(config(endpoint, **names))
    finally:
        stop.set()


def test_a_ros_2_driver_s_camera_info_is_heard(endpoint, session):
    k = [50.0, 0, 31.5, 0, 51.0, 23.5, 0, 0, 1]
    camera = ros2_driver(session, endpoint, info_message((64, 48), k))
    assert (camera.size, camera.fx, camera.cx) == ((64, 48), 50.0, 32.0)


def test_a_camera_that_our_model_cannot_hold_is_an_error(endpoint, session):
    info = info_message((64, 48), [50.0, 0, 31, 0, 50, 23, 0, 0, 1], (1, 2, 3, 4), "equidistant")
    with pytest.raises(WireError, match="equidistant"):
        ros2_driver(session, endpoint, info)
