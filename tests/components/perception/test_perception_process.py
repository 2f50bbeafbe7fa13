"""The perception process itself, between a real Zenoh and a stand-in for the gate."""

import contextlib
import json
import os
import signal
import socket
import subprocess
import sys
import threading
import time
from pathlib import Path
from typing import ClassVar

import numpy as np
import pytest
from loopback import free_endpoint, peer
from textured_wall import Wall, texture

from dfvs_common.zenoh_session import open_session
from dfvs_core.geometry.camera import CameraModel
from dfvs_core.messages.frame import (
    BOOT_ID_FILE,
    Frame,
    PixelFormat,
    clock_identity,
    decode_frame,
    decode_header,
    encode_frame,
)
from dfvs_core.messages.goal import GoalSidecar, Mount
from dfvs_core.messages.goal_command import GoalCommand, goal_digest
from dfvs_core.messages.image import encode_png
from dfvs_core.messages.link import (
    GateStatus,
    PerceptionReport,
    VehicleState,
    from_datagram,
    to_datagram,
)
from dfvs_core.messages.topics import Topics
from dfvs_core.perception.flow_grid import decode_flow_grid
from dfvs_service.goal_store import GoalStore
from dfvs_service.settings.config import load_config
from dfvs_service.zenoh_session import subscribe_kept

pytestmark = pytest.mark.real_time

CAMERA = CameraModel.from_horizontal_fov(320, 240, 1.3)
TOPICS = Topics("perceiver")
CLOCK = clock_identity(Path(BOOT_ID_FILE).read_text())
STARTUP_S = 30.0


class Rig:
    """The process, the operator link's Zenoh session, and the gate's end of its socket."""

    overrides: ClassVar[dict[str, object]] = {}

    def __init__(self, folder, picture, launcher=()):
        self.picture = picture
        self.goal = ""
        self.new_goals = GoalStore(folder / "new-goals")
        sidecar = GoalSidecar(CAMERA)
        (folder / "goal.png").write_bytes(encode_png(picture))
        (folder / "goal.json").write_text(sidecar.to_json())
        overrides = {"vehicle.name": TOPICS.vehicle, **self.overrides}
        config, _ = load_config(None, overrides).with_camera((320, 240), sidecar)
        (folder / "config.json").write_text(config.to_json())
        self.gate = socket.socket(socket.AF_UNIX, socket.SOCK_DGRAM)
        self.gate.bind(str(folder / "gate.sock"))
        self.gate.settimeout(STARTUP_S)
        self.address = str(folder / "perception.sock")
        command = [sys.executable, "-m", "dfvs_service.perception", "--runtime", str(folder)]
        self.session = peer(listen=(f"unixsock-stream/{folder / 'zenoh.sock'}",))
        self.process = subprocess.Popen([*launcher, *command], stderr=subprocess.PIPE)
        self.seq = 0

    def __enter__(self):
        return self

    def __exit__(self, *_):
        if self.process.poll() is None:
            self.process.kill()
        self.process.wait()
        self.process.stderr.close()  # not read to its end: an orphan may hold the other one
        self.session.close()
        self.gate.close()

    def report(self):
        """Next report of the process."""
        return from_datagram(PerceptionReport, self.gate.recv(65536))

    def report_where(self, accept, within_s=STARTUP_S):
        deadline = time.monotonic() + within_s
        while time.monotonic() < deadline:
            data = self.gate.recv(65536)
            if b'"healthy"' in data and accept(report := from_datagram(PerceptionReport, data)):
                return report
        raise AssertionError("no such report")

    def tell_vehicle(self):
        vehicle = VehicleState(time.monotonic_ns(), 0.0, 0.0, 0.0, (0.0,) * 3, (0.0,) * 3)
        self.gate.settimeout(STARTUP_S)
        status = GateStatus("READY", "tested", vehicle, goal=self.goal)
        self.gate.sendto(to_datagram(status), self.address)

    def offer(self, picture, sidecar=""):
        """Keep a new goal as the operator link does; its digest."""
        data = GoalCommand(picture, sidecar).to_bytes()
        digest = goal_digest(data)
        self.new_goals.keep(digest, data)
        return digest

    def shoot(self, rng, picture=None):
        """Publish one noisy frame, with vehicle states around it."""
        self.seq += 1
        image = self.picture if picture is None else picture
        noise = rng.integers(-2, 3, image.shape)
        image = np.clip(image.astype(int) + noise, 0, 255).astype(np.uint8)
        self.tell_vehicle()
        self.publish(image, time.monotonic_ns())
        self.tell_vehicle()

    def publish(self, image, t_ns):
        frame = Frame(image, t_ns, self.seq)
        payload, attachment = encode_frame(frame, PixelFormat.JPEG, CLOCK)
        self.session.put(TOPICS.camera, payload, attachment=attachment)

    def shoot_until(self, rng, accept):
        """Publish frames until one is reported as wanted."""
        deadline = time.monotonic() + STARTUP_S
        self.gate.settimeout(STARTUP_S)
        while time.monotonic() < deadline:
            self.shoot(rng)
            report = from_datagram(PerceptionReport, self.gate.recv(65536))
            if accept(report):
                return report
        raise AssertionError(f"last report: {report}")


@contextlib.contextmanager
def running(folder):
    with Rig(folder, Wall(texture(np.random.default_rng(20))).picture()) as rig:
        rig.report()  # it is up
        yield rig


@pytest.fixture
def rig(tmp_path):
    with running(tmp_path) as rig:
        yield rig


@pytest.fixture(scope="module")
def shared(tmp_path_factory):
    """A process for tests that change nothing of it for good."""
    with running(tmp_path_factory.mktemp("shared")) as rig:
        yield rig


def test_frames_become_reports_and_telemetry_until_it_is_told_to_end(rig, rng):
    heard = {}
    names = ("servo", "timing", "preview")
    subscribers = [
        rig.session.declare_subscriber(
            TOPICS.telemetry(name), lambda sample, name=name: heard.__setitem__(name, sample)
        )
        for name in names
    ]
    silent = rig.report()
    assert not silent.healthy
    assert "no camera frame" in silent.reason

    def all_told(report):
        return report.healthy and set(heard) == set(names) and b"servo" in told("timing")

    def told(name):
        return heard[name].payload.to_bytes()

    report = rig.shoot_until(rng, all_told)
    assert report.error_m < 0.02  # the camera sees the goal image itself
    assert rig.shoot_until(rng, lambda r: r.reached).error_m < 0.02
    servo = json.loads(told("servo"))
    assert servo["status"] == "OK"
    timing = json.loads(told("timing"))
    assert timing["stages"]["capture_to_report"]["p50_ms"] > 0
    preview = heard["preview"]
    header = decode_header(preview.attachment.to_bytes())
    assert decode_frame(preview.payload.to_bytes(), header).image.shape == (240, 320, 3)
    assert len(subscribers) == 3
    rig.process.send_signal(signal.SIGTERM)
    assert rig.process.wait(STARTUP_S) == 0


def test_late_joiners_are_told_the_configuration(shared, rng):
    found = []
    subscriber = subscribe_kept(
        shared.session,
        TOPICS.telemetry("config"),
        lambda sample: found.append(json.loads(sample.payload.to_bytes())),
    )
    shared.shoot_until(rng, lambda _: bool(found))
    assert found[0]["vehicle"]["name"] == TOPICS.vehicle
    subscriber.undeclare()


def test_late_joiners_are_shown_the_goal_and_the_flow_while_they_look(shared, rng):
    goals, grids = [], []
    goal = subscribe_kept(shared.session, TOPICS.telemetry("goal"), goals.append)
    flow = shared.session.declare_subscriber(
        TOPICS.telemetry("flow"), lambda sample: grids.append(sample.payload.to_bytes())
    )
    shared.shoot_until(rng, lambda r: r.healthy and goals and grids)
    header = decode_header(goals[0].attachment.to_bytes())
    shown = decode_frame(goals[0].payload.to_bytes(), header).image
    assert np.abs(shown.astype(int) - shared.picture).mean() < 10
    grid = decode_flow_grid(grids[-1])
    assert np.median(np.abs(grid.flow[grid.confidence > 0.5])) < 1.0
    goal.undeclare()
    flow.undeclare()


def test_frames_faster_than_perception_are_skipped_not_queued(shared, rng):
    """Newest wins: the last of a flood is worked on, and by far not all before it."""
    shared.shoot_until(rng, lambda r: r.healthy)
    seen = set()
    for _ in range(150):
        shared.shoot(rng)
        time.sleep(0.004)  # 250 frames a second: faster than any matching
        shared.gate.setblocking(False)
        with contextlib.suppress(BlockingIOError):
            while True:
                seen.add(shared.report().seq)
    last = shared.seq
    shared.shoot_until(rng, lambda r: seen.add(r.seq) or r.seq >= last)
    assert len(seen) < 100


def test_the_gate_is_not_told_of_a_frame_that_is_not_tracked_alone(shared, rng):
    """It counts as a frame that did not come; the second in a row is reported."""
    other = Wall(texture(np.random.default_rng(7))).picture()
    for _ in range(5):  # frames that a busy machine delays are lost at once
        shared.shoot_until(rng, lambda r: r.healthy)
        tracked = shared.seq
        shared.shoot(rng, other)
        time.sleep(0.1)
        shared.shoot(rng, other)
        report = shared.report_where(lambda r, last=tracked: r.seq > last)
        if report.seq == shared.seq:
            break
    assert report.seq == shared.seq
    assert not report.healthy


def test_a_new_goal_is_looked_for_only_after_the_gate_accepted_it(rig, rng):
    rig.shoot_until(rng, lambda r: r.healthy)
    other = Wall(texture(rng)).picture()
    digest = rig.offer(encode_png(other))
    old = rig.shoot_until(rng, lambda r: r.reached)
    assert old.goal == ""
    rig.goal = digest
    # The camera still shows the old goal, which has nothing in common with the new one.
    assert not rig.shoot_until(rng, lambda r: r.goal == digest and r.t_capture_ns > 0).healthy
    rig.picture = other
    assert rig.shoot_until(rng, lambda r: r.reached).healthy


def test_a_signed_goal_that_is_no_picture_is_said_and_flown_by_nothing(rig, rng):
    rig.shoot_until(rng, lambda r: r.healthy)
    rig.goal = rig.offer(b"GIF89a")
    report = rig.shoot_until(rng, lambda r: r.goal == rig.goal)
    assert not report.healthy
    assert "the new goal cannot be used" in report.reason


def test_a_commanded_goal_of_another_mounting_is_flown_to_with_a_warning(rig, rng):
    turned = GoalSidecar(CAMERA, mount=Mount(yaw_rad=0.1)).to_json()
    rig.goal = rig.offer(encode_png(rig.picture), turned)
    rig.shoot_until(rng, lambda r: r.goal == rig.goal and r.healthy)
    rig.process.terminate()
    _, told = rig.process.communicate(timeout=STARTUP_S)
    assert b"warning: the goal counts as taken at roll 0.0, pitch 0.0, yaw 5.7 deg" in told


def test_rubbish_on_the_camera_key_does_no_harm(shared, rng):
    shared.shoot_until(rng, lambda r: r.healthy)
    for payload, attachment in ((b"", b""), (b"x" * 9999, os.urandom(48)), (b"\xff" * 64, b"a")):
        shared.session.put(TOPICS.camera, payload, attachment=attachment)
        shared.gate.settimeout(STARTUP_S)
        shared.report_where(lambda r: "cannot be read" in r.reason)
    assert shared.shoot_until(rng, lambda r: r.reached).healthy


def test_a_flood_of_bad_frames_does_not_crowd_out_the_good_ones(shared, rng):
    shared.shoot_until(rng, lambda r: r.healthy)
    stopped = threading.Event()

    def flood():
        while not stopped.wait(0.002):
            shared.session.put(TOPICS.camera, b"x" * 1000, attachment=b"no header")

    thread = threading.Thread(target=flood)
    thread.start()
    try:
        healthy, first = set(), shared.seq
        for _ in range(20):
            shared.shoot(rng)
            with contextlib.suppress(AssertionError, TimeoutError):
                shared.gate.settimeout(0.5)
                report = shared.report_where(lambda r: r.healthy and r.seq > first, 0.3)
                healthy.add(report.seq)
    finally:
        stopped.set()
        thread.join()
    # A bad frame every 2 ms would replace nearly every good one before it is taken.
    assert len(healthy) >= 10


def test_it_does_not_outlive_the_service_that_started_it(tmp_path, rng):
    code = (
        "import os, subprocess, sys; from dfvs_common.lifecycle import child_environment; "
        "subprocess.call(sys.argv[1:], env=os.environ | child_environment())"
    )
    picture = Wall(texture(rng)).picture()
    with Rig(tmp_path, picture, launcher=(sys.executable, "-c", code)) as rig:
        rig.report()  # it is up
        rig.process.kill()
        # Its end of the error pipe closes when it is gone, and no sooner.
        rig.process.communicate(timeout=STARTUP_S)


class RouterRig(Rig):
    """The process as a client of a router that is not there yet."""

    endpoint = free_endpoint()
    overrides: ClassVar[dict[str, object]] = {"zenoh.mode": "client", "zenoh.connect": [endpoint]}


def test_a_router_that_comes_later_is_awaited_and_its_absence_reported(tmp_path):
    with RouterRig(tmp_path, Wall(texture(np.random.default_rng(20))).picture()) as rig:
        assert "nobody listens on" in rig.report().reason
        with open_session("router", (), (rig.endpoint,)):
            rig.report_where(lambda report: "no camera frame" in report.reason)
        rig.process.terminate()
        assert rig.process.wait(STARTUP_S) == 0
