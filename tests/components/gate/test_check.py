"""``dfvs-service --check`` beside a simulated vehicle and a camera: crosses for what is wrong."""

import contextlib
import json
import signal
import subprocess
import sys
import threading
import time
from pathlib import Path

import cv2
import numpy as np
import pytest
from gate_flight import hovering_vehicle
from loopback import free_endpoint
from textured_wall import Wall, texture
from waiting import until

from dfvs_core.geometry.camera import CameraModel
from dfvs_core.messages.frame import BOOT_ID_FILE, Frame, PixelFormat, clock_identity, encode_frame
from dfvs_core.messages.goal import Goal, GoalSidecar
from dfvs_core.messages.topics import Topics
from dfvs_service.preflight.check import watching
from dfvs_service.settings.config import load_config
from dfvs_service.settings.runtime import RuntimeFolder
from dfvs_service.settings.sections import ZenohSection
from dfvs_service.supervisor.parent import Parent, Programs, prepare_runtime
from dfvs_service.zenoh_session import open_session

pytestmark = pytest.mark.real_time

SIZE = (160, 120)
"""Small pictures are matched in time on a busy machine as well."""
CAMERA = CameraModel.from_horizontal_fov(*SIZE, 1.3)
TOPICS = Topics("checked")
CLOCK = clock_identity(Path(BOOT_ID_FILE).read_text())
NOMINAL_HZ = 20.0  # perception calls a camera silent after 0.1 s
NEVER_SENT = ("setpoint", "mode_command", "arm_command")


class Camera:
    """Publishes a noisy picture at a rate, until told otherwise."""

    def __init__(self, endpoint, picture):
        self.session = open_session(ZenohSection("peer", (endpoint,), ()))
        self.picture, self.rate_hz = picture, NOMINAL_HZ
        self._stopped = threading.Event()
        self._thread = threading.Thread(target=self._run)
        self._thread.start()

    def _run(self):
        rng, seq = np.random.default_rng(1), 0
        while not self._stopped.wait(1.0 / max(self.rate_hz, 1.0)):
            if self.rate_hz <= 0:
                continue
            seq += 1
            noise = rng.integers(-2, 3, self.picture.shape)
            image = np.clip(self.picture.astype(int) + noise, 0, 255).astype(np.uint8)
            frame = Frame(image, time.monotonic_ns(), seq)
            payload, attachment = encode_frame(frame, PixelFormat.JPEG, CLOCK)
            self.session.put(TOPICS.camera, payload, attachment=attachment)

    def close(self):
        self._stopped.set()
        self._thread.join()
        self.session.close()


class Watch:
    """Display that keeps the last beat and every line."""

    def __init__(self):
        self.beat, self.lines = None, []

    def show(self, beat):
        self.beat = beat

    def log(self, line):
        self.lines.append(line)

    def close(self):
        pass

    def wait(self, name, ok, text="", seconds=60.0):
        """Check of a name, once it is as wanted."""

        def found():
            checks = () if self.beat is None else self.beat.checks
            return [c for c in checks if c.name == name and c.ok is ok and text in c.detail]

        fitting = until(found, seconds)
        assert fitting, f"{name} never {ok} {text!r}: {self.beat} {self.lines}"
        return fitting[0]


@pytest.fixture(scope="module")
def views():
    rng = np.random.default_rng(20)
    walls = [Wall(texture(rng)).picture() for _ in range(2)]
    return [cv2.resize(wall, SIZE, interpolation=cv2.INTER_AREA) for wall in walls]


@contextlib.contextmanager
def camera_running(endpoint, picture):
    camera = Camera(endpoint, picture)
    try:
        yield camera
    finally:
        camera.close()


def settings(mavlink_port, endpoint, **gate):
    overrides = {
        "vehicle.name": TOPICS.vehicle,
        "vehicle.mavlink": f"udpin://127.0.0.1:{mavlink_port}",
        "zenoh.listen": [endpoint],
        "camera.timeout_s": 100,
        "gate.min_frame_hz": 5.0,  # however busy the machine is
        **{f"gate.{name}": value for name, value in gate.items()},
    }
    return load_config(None, overrides).with_camera(SIZE, GoalSidecar(CAMERA))[0]


@contextlib.contextmanager
def service_running(folder, config, picture):
    """The service's real processes under a parent in this process; what it shows."""
    runtime, watch = RuntimeFolder(folder), Watch()
    prepare_runtime(runtime, config, Goal(picture, GoalSidecar(CAMERA)))
    parent = Parent(runtime, Programs(), watch)
    thread = threading.Thread(target=parent.run)
    thread.start()
    try:
        yield watch
    finally:
        parent.stop(signal.SIGTERM, None)
        thread.join(30.0)


def test_everything_that_goes_wrong_gets_its_cross_and_its_remedy(vehicle, views, tmp_path):
    endpoint = free_endpoint()
    with (
        camera_running(endpoint, views[0]) as camera,
        service_running(tmp_path, watching(settings(vehicle.port, endpoint)), views[0]) as watch,
    ):
        watch.wait("frames", ok=True, seconds=60.0)
        parameters = "COM_OF_LOSS_T 0.5, COM_OBL_RC_ACT 5"
        watch.wait("parameters", ok=True, text=parameters)
        for name in ("link", "estimator", "health", "battery", "goal", "sole commander"):
            watch.wait(name, ok=True)

        def crossed(name, text):
            assert watch.wait(name, ok=False, text=text).remedy

        vehicle.order("battery 0.1")
        crossed("battery", "10% left, 20% needed")
        vehicle.order("battery 0.9")
        watch.wait("battery", ok=True)

        intruder = camera.session.liveliness().declare_token(TOPICS.lease("standby", "intruder"))
        crossed("sole commander", "intruder")
        intruder.undeclare()
        watch.wait("sole commander", ok=True)

        camera.rate_hz = 0.0
        crossed("frames", "no camera frame")
        camera.rate_hz = NOMINAL_HZ
        watch.wait("frames", ok=True)

        camera.picture = np.ascontiguousarray(views[0][::2, ::2])
        crossed("frames", "size")
        camera.picture = views[1]
        crossed("frames", "perception unhealthy")
        camera.picture = views[0]
        watch.wait("frames", ok=True)

        vehicle.order("mute")
        crossed("link", "lost")
    assert not [kind for kind in NEVER_SENT if vehicle.events(kind)]


@pytest.fixture
def goal(tmp_path, views):
    path = tmp_path / "goal.png"
    cv2.imwrite(str(path), views[0][:, :, ::-1])
    path.with_suffix(".json").write_text(GoalSidecar(CAMERA).to_json())
    return path


def run_check(goal, mavlink_port, endpoint, *words):
    command = [sys.executable, "-m", "dfvs_service.cli", "--goal", str(goal), "--check"]
    command += ["--vehicle", TOPICS.vehicle, "--mavlink", f"udpin://127.0.0.1:{mavlink_port}"]
    command += ["--set", f"zenoh.listen=['{endpoint}']", "--set", "gate.min_frame_hz=5", *words]
    return subprocess.run(command, capture_output=True, text=True, timeout=90, check=False)


def test_a_good_vehicle_gets_ticks_only_and_nothing_is_sent_to_it(goal, views, tmp_path):
    endpoint = free_endpoint()
    with hovering_vehicle(tmp_path) as vehicle, camera_running(endpoint, views[0]):
        picture = tmp_path / "check.png"
        words = ("--check-timeout", "40", "--json", "--image", str(picture))
        done = run_check(goal, vehicle.port, endpoint, *words)
        assert (done.returncode, done.stderr) == (0, "")
        document = json.loads(done.stdout)
        assert document["ok"] is True
        names = [check["name"] for check in document["checks"]]
        assert names[:4] == ["camera", "stream", "model", "speed"]
        assert document["checks"][1]["detail"].startswith("160 x 120 px, ")
        assert {"link", "estimator", "battery", "parameters", "frames", "goal"} <= set(names)
        assert "sole commander" in names
        (mounting,) = [c for c in document["checks"] if c["name"] == "mounting"]
        assert mounting["status"] == "waiting"
        goal_and_frame = cv2.imread(str(picture))[100:340].astype(int)
        left, right = goal_and_frame[:, :480], goal_and_frame[:, -480:]
        assert 0.0 < np.abs(left - right).mean() < 40.0  # the same view, with noise and flow
        assert not [kind for kind in NEVER_SENT if vehicle.events(kind)]


def test_a_dangerous_failsafe_and_a_missing_camera_are_crosses_in_the_table(goal, tmp_path):
    with hovering_vehicle(tmp_path) as vehicle:
        vehicle.order("parameter COM_OF_LOSS_T 60")
        done = run_check(goal, vehicle.port, free_endpoint(), "--check-timeout", "6")
        assert done.returncode == 1
        lines = done.stdout.splitlines()
        (parameters,) = [n for n, line in enumerate(lines) if line.startswith("✗ parameters")]
        assert "COM_OF_LOSS_T is 60 s, 1 at most" in lines[parameters]
        assert "→ set them in the ground station" in lines[parameters + 1]
        assert any(line.startswith("✗ frames") and "no camera frame" in line for line in lines)
        assert any(line.startswith("✓ battery") for line in lines)
        assert not [kind for kind in NEVER_SENT if vehicle.events(kind)]
