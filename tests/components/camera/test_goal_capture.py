"""``dfvs-camera goal``: pictures from a folder and from Zenoh, attitudes from all sides."""

import contextlib
import threading
import time

import cv2
import numpy as np
import pytest
from loopback import free_endpoint, peer
from test_camera_process import CAMERA, SIZE, TOPICS

from dfvs_core.gate.events import Attitude, LocalPosition
from dfvs_core.messages.frame import PixelFormat
from dfvs_core.messages.image import encode_png
from dfvs_service.camera import cli
from dfvs_service.camera.goal import sharpness_of
from dfvs_service.camera.publisher import FramePublisher, PublishOptions
from dfvs_service.frames import CapturedImage
from dfvs_service.route.vehicle_state import VehicleStateListener
from dfvs_service.settings.calibration_file import write_calibration
from dfvs_service.settings.goal_file import load_goal


@pytest.fixture
def pictures(tmp_path, rng):
    """Three pictures, of which the second is the sharpest."""
    folder = tmp_path / "pictures"
    folder.mkdir()
    for i, contrast in enumerate((20, 90, 40)):
        image = np.full((SIZE[1], SIZE[0], 3), 128) + rng.integers(-contrast, contrast, (48, 64, 1))
        (folder / f"{i}.png").write_bytes(encode_png(image.astype(np.uint8)))
    write_calibration(tmp_path / "camera.toml", CAMERA, [])
    return folder


def words(folder, *more):
    calibration = ["--calibration", str(folder.parent / "camera.toml")]
    out = ["--out", str(folder.parent / "goal.png")]
    return ["goal", "--source", str(folder), "--rate", "100", *calibration, *out, *more]


def test_the_sharpest_picture_is_taken_with_the_attitude_that_is_given(pictures, capsys):
    assert cli.main(words(pictures, "--attitude", "1.5,-2", "--frames", "3")) == 0
    goal = load_goal(pictures.parent / "goal.png")
    expected = (pictures / "1.png").read_bytes()
    assert encode_png(goal.image) == expected
    assert goal.sidecar.camera == CAMERA
    assert np.degrees(goal.sidecar.roll_rad) == pytest.approx(1.5)
    assert np.degrees(goal.sidecar.pitch_rad) == pytest.approx(-2.0)
    assert "level" not in capsys.readouterr().err


def test_the_autopilot_s_attitude_is_taken_without_a_position(pictures, monkeypatch):
    def connect(listener, *_):
        now_ns = time.monotonic_ns()
        for k in range(30):
            listener.on_event(Attitude(now_ns + k * 100_000_000, 0.1, -0.2, 0.3))

    monkeypatch.setattr(VehicleStateListener, "connect", connect)
    assert cli.main(words(pictures, "--mavlink", "udpin://127.0.0.1:1")) == 0
    sidecar = load_goal(pictures.parent / "goal.png").sidecar
    assert (sidecar.roll_rad, sidecar.pitch_rad) == pytest.approx((0.1, -0.2))


def test_a_missing_attitude_is_not_told_as_a_missing_camera(pictures, monkeypatch, refused):
    monkeypatch.setattr(VehicleStateListener, "connect", lambda *_: None)
    line = refused(cli.main, *words(pictures, "--mavlink", "udpin://127.0.0.1:1"))
    assert "ATTITUDE_QUATERNION from the autopilot" in line
    assert "--attitude" in line


@pytest.mark.parametrize(("grey", "word"), [(0, "black"), (255, "white"), (90, "contrast")])
def test_an_image_that_shows_nothing_is_no_goal(pictures, refused, grey, word):
    for path in pictures.iterdir():
        path.write_bytes(encode_png(np.full((SIZE[1], SIZE[0], 3), grey, np.uint8)))
    assert word in refused(cli.main, *words(pictures))
    assert not (pictures.parent / "goal.png").exists()


def test_a_level_vehicle_is_assumed_aloud(pictures, capsys):
    assert cli.main(words(pictures, "--set", "camera.mount.pitch_deg=-20")) == 0
    err = capsys.readouterr().err
    assert "counts as level" in err
    assert "straight ahead" not in err
    sidecar = load_goal(pictures.parent / "goal.png").sidecar
    assert sidecar.roll_rad == sidecar.pitch_rad == 0.0
    assert np.degrees(sidecar.mount.pitch_rad) == pytest.approx(-20.0)


def test_a_camera_that_looks_ahead_is_assumed_aloud(pictures, capsys):
    assert cli.main(words(pictures, "--attitude", "0,0")) == 0
    assert "mounted straight ahead: no camera.mount" in capsys.readouterr().err


@pytest.mark.parametrize(
    ("more", "message"),
    [
        (("--attitude", "flat"), "--attitude is 'flat'"),
        (("--attitude", "1,200"), "90 degrees"),
        (("--attitude", "0,0", "--mavlink", "udpin://127.0.0.1:1"), "only one of them"),
        (("--mavlink", "/dev/ttyACM0"), "vehicle.mavlink = '/dev/ttyACM0'; expected udpin://"),
        (("--frames", "0"), "--frames is 0"),
        (("--source", "none", "--out", "goal.jpg"), "--out is 'goal.jpg'; expected a name that"),
        (("--source", "none", "--out", "none/goal.png"), "lies in no folder"),
        (("--timeout", "inf"), "--timeout is inf; expected 0.1 to 3600"),
        (("--size", "640x480"), "the calibration's size"),
        (("--source", "zenoh"), "--rate beside --source zenoh"),
    ],
)
def test_what_cannot_be_is_one_line_and_leaves_nothing(pictures, refused, more, message):
    assert message in refused(cli.main, *words(pictures, *more))
    assert not (pictures.parent / "goal.png").exists()


@pytest.mark.parametrize(
    ("announced_s", "message"),
    [(0.0, "nothing is known of the camera's lens"), (0.1, "no camera announced its calibration")],
)
def test_without_a_calibration_nothing_is_taken(pictures, refused, announced_s, message):
    without = [w for w in words(pictures) if "camera.toml" not in w and w != "--calibration"]
    announced = ("--set", f"camera.announced_s={announced_s}")
    line = refused(cli.main, *without, *announced)
    assert message in line
    assert "give --calibration FILE" in line


@contextlib.contextmanager
def camera_publishing(endpoint, image):
    """A calibrated camera that sends to a service's endpoint."""
    stop = threading.Event()
    with peer(connect=(endpoint,)) as session:
        options = PublishOptions(TOPICS.vehicle, PixelFormat.PNG, camera=CAMERA)
        publisher = FramePublisher(session, options)

        def work():
            while not stop.wait(0.05):
                publisher.publish(CapturedImage(image, time.monotonic_ns()))

        thread = threading.Thread(target=work)
        thread.start()
        try:
            yield
        finally:
            stop.set()
            thread.join()


@pytest.mark.parametrize("is_service_running", [False, True])
def test_the_camera_that_publishes_for_the_service_can_be_asked(tmp_path, rng, is_service_running):
    endpoint = free_endpoint()
    image = rng.integers(0, 255, (SIZE[1], SIZE[0], 3)).astype(np.uint8)
    where = ["--vehicle", TOPICS.vehicle, "--set", f"zenoh.listen=['{endpoint}']"]
    where += ["--set", "camera.announced_s=10", "--source", "zenoh"]
    out = tmp_path / "taken.png"
    service = peer(listen=(endpoint,)) if is_service_running else contextlib.nullcontext()
    with service, camera_publishing(endpoint, image):
        code = cli.main(["goal", *where, "--attitude", "0,0", "--out", str(out)])
    assert code == 0
    goal = load_goal(out)
    assert goal.sidecar.camera == CAMERA  # as the camera announced it
    np.testing.assert_array_equal(goal.image, image)


def test_a_watch_keeps_every_state_once_attitude_and_position_are_known():
    watch = VehicleStateListener()
    watch.on_event(Attitude(10, 0.1, 0.2, 0.3))
    assert watch.new_states() == []
    watch.on_event(LocalPosition(11, (1.0, 2.0, 3.0), (0.1, 0.2, 0.3)))
    watch.on_event(Attitude(12, 0.2, 0.2, 0.3))
    watch.on_event(LocalPosition(13, (1.0, 2.0, 3.0), (0.1, 0.2, 0.3)))
    assert [state.t_ns for state in watch.new_states()] == [10, 12]
    assert watch.new_states() == []


def test_sharpness_falls_with_blur(rng):
    image = rng.integers(0, 255, (48, 64, 3)).astype(np.uint8)
    blurred = cv2.GaussianBlur(image, (5, 5), 1.5)
    assert sharpness_of(CapturedImage(image, 0)) > 4 * sharpness_of(CapturedImage(blurred, 0))
