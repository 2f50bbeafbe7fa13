"""Routes taught by frames of a box whose flow is known exactly."""

import json
import os
import signal
from pathlib import Path

import numpy as np
import pytest
from box_sight import CAMERA, CLOCK, MS, KnowingMatcher, picture

from dfvs_common.goal_file import write_goal
from dfvs_core.errors import ConfigError
from dfvs_core.messages.frame import Frame, PixelFormat, encode_frame
from dfvs_core.messages.goal import Mount
from dfvs_core.messages.link import VehicleState
from dfvs_core.perception.route import RouteRecordingLimits
from dfvs_service import cli
from dfvs_service.camera.sources.source import image_paths
from dfvs_service.frames import RawSample
from dfvs_service.perception.assembly import Clocks
from dfvs_service.route.cli import RouteProgress
from dfvs_service.route.recording import (
    Event,
    RouteRecorder,
    prepare_route_folder,
    route_recording_settings,
)
from dfvs_service.route.vehicle_state import VehicleStateListener
from dfvs_service.settings.config import load_config
from dfvs_service.settings.goal_file import load_goal, route_images, sidecar_of


class Rig:
    """A teacher with clock and vehicle in hand."""

    def __init__(self, folder):
        config = route_recording_settings(load_config(None, {}), CAMERA)
        self.now_ns = 5_000 * MS
        clocks = Clocks(CLOCK, lambda: self.now_ns, lambda: self.now_ns)
        limits = RouteRecordingLimits(overlap=0.5, turn_rad=0.35)
        self.teacher = RouteRecorder(config, folder, KnowingMatcher(), clocks, limits)
        self.seq = 0
        self.on_ground, self.height_m = False, 1.0

    def hear(self, yaw_deg):
        rest, position = (0.0, 0.0, 0.0), (0.0, 0.0, -self.height_m)
        state = VehicleState(self.now_ns, 0.02, -0.03, np.radians(yaw_deg), rest, position)
        self.teacher.on_vehicle_states([state], on_ground=self.on_ground)

    def frame(self, yaw_deg, *, heard=True):
        return self.show(picture(yaw_deg), yaw_deg, heard=heard)

    def show(self, image, yaw_deg=10.0, *, heard=True, clock=CLOCK, damaged=False):
        for _ in range(2):
            self.now_ns += 50 * MS
            if heard:
                self.hear(yaw_deg)
        self.seq += 1
        image[1, 1] = self.seq % 251
        frame = Frame(image, self.now_ns, self.seq)
        payload, attachment = encode_frame(frame, PixelFormat.RGB8, clock)
        if damaged:
            payload = payload[:-1] + bytes([payload[-1] ^ 1])
        return self.teacher.process(RawSample(payload, attachment, self.now_ns))


def headings(folder):
    """Headings of the goals of a route, in degrees, by the pictures' first pixels."""
    found = []
    for path in route_images([folder]):
        high, low = load_goal(path).image[0, 0, :2]
        found.append((int(high) * 256 + int(low)) * 0.01)
    return found


def test_a_goal_is_taken_whenever_the_last_one_leaves_the_view(tmp_path):
    rig = Rig(tmp_path)
    events = [rig.frame(yaw) for yaw in np.arange(10.0, 75.0, 2.0)]
    assert events[0] is Event.SAVED
    assert events[1] is Event.NOTHING
    assert rig.teacher.finish()
    taken = headings(tmp_path)
    assert taken[0] == 10.0
    assert taken[-1] == 74.0
    # 0.35 rad are 20 degrees; two degrees are between the frames.
    assert all(20.0 < step <= 23.0 for step in np.diff(taken)[:-1])
    assert [path.name for path in route_images([tmp_path])][:2] == ["001.png", "002.png"]


def test_sidecars_tell_attitude_lens_and_time(tmp_path):
    rig = Rig(tmp_path)
    rig.frame(10.0)
    sidecar = load_goal(tmp_path / "001.png").sidecar
    assert sidecar.camera == CAMERA
    assert sidecar.roll_rad == pytest.approx(0.02)
    assert sidecar.pitch_rad == pytest.approx(-0.03)
    assert sidecar.taken_at.endswith("+00:00")


def test_without_an_attitude_nothing_is_taken(tmp_path):
    rig = Rig(tmp_path)
    assert [rig.frame(yaw, heard=False) for yaw in (10.0, 12.0)] == [Event.NOTHING] * 2
    assert not rig.teacher.finish()
    assert list(tmp_path.iterdir()) == []
    assert rig.frame(14.0) is Event.SAVED


@pytest.mark.parametrize(
    ("how", "reason"),
    [
        ("wrong size", "size is not the camera's"),
        ("black", "the image is black"),
        ("damaged", "cannot be read"),
        ("other clock", "another machine's clock"),
        ("no attitude", "attitude at capture is not known"),
    ],
)
@pytest.mark.parametrize("is_first", [True, False])
def test_a_frame_that_no_flight_would_use_is_refused_with_its_reason(
    tmp_path, how, reason, is_first
):
    rig, image, options = Rig(tmp_path), picture(10.0), {}
    if not is_first:
        assert rig.frame(10.0) is Event.SAVED
    if how == "wrong size":
        image = np.ascontiguousarray(image[::2, ::2])
    elif how == "black":
        image = np.zeros_like(image)
    elif how == "damaged":
        options["damaged"] = True
    elif how == "other clock":
        options["clock"] = b"x" * len(CLOCK)
    else:
        options["heard"] = False
        rig.now_ns += 1_000 * MS
    assert rig.show(image, **options) is Event.NOTHING
    assert reason in rig.teacher.refusal
    assert rig.teacher.count == (0 if is_first else 1)
    assert rig.frame(12.0) is (Event.SAVED if is_first else Event.NOTHING)
    assert rig.teacher.refusal == ""


def test_a_view_without_the_last_goal_is_lost_until_it_is_back(tmp_path):
    rig = Rig(tmp_path)
    rig.frame(10.0)
    assert rig.frame(12.0) is Event.NOTHING
    assert rig.frame(170.0) is Event.LOST
    assert rig.frame(14.0) is Event.NOTHING
    assert rig.frame(170.0) is Event.LOST
    assert rig.teacher.finish()
    assert headings(tmp_path) == [10.0, 14.0]


def test_no_goal_is_taken_on_the_ground_or_close_above_it(tmp_path):
    rig = Rig(tmp_path)
    for yaw, on_ground, height_m in (
        *((10.0, None, 0.1), (11.0, True, 0.1), (12.0, False, 0.1), (13.0, False, 0.5)),
        *((14.0, False, 0.7), (24.0, False, 0.7), (34.0, False, 0.3), (44.0, True, 0.1)),
    ):
        rig.on_ground, rig.height_m = on_ground, height_m
        for _ in range(2):
            rig.frame(yaw)
        assert ("above the ground" in rig.teacher.refusal) == (height_m < 0.6)
    assert rig.teacher.finish()
    assert headings(tmp_path) == [14.0, 24.0]


def test_one_frame_that_is_not_tracked_is_not_out_of_sight(tmp_path, monkeypatch):
    rig = Rig(tmp_path)
    for _ in range(5):
        rig.frame(10.0)
    with monkeypatch.context() as untracked:
        untracked.setattr(KnowingMatcher, "track", lambda *_: None)
        assert rig.frame(12.0) is Event.NOTHING
    assert rig.frame(12.0) is Event.NOTHING


def test_the_last_goal_is_saved_however_long_the_route_is_out_of_sight_by_then(tmp_path):
    rig = Rig(tmp_path)
    for yaw in (10.0, 14.0):
        rig.frame(yaw)
    for _ in range(60):
        assert rig.frame(170.0) is Event.LOST
    assert rig.teacher.finish()
    assert headings(tmp_path) == [10.0, 14.0]


@pytest.mark.parametrize("name", ["001.png", "IMG_1.jpg", "002.jpeg", "old.PNG"])
def test_a_folder_with_an_image_in_it_is_refused(name, tmp_path):
    """The route would lead to it, too."""
    prepare_route_folder(tmp_path / "new")
    (tmp_path / "new" / name).write_bytes(b"")
    with pytest.raises(ConfigError, match="holds images already"):
        prepare_route_folder(tmp_path / "new")


def test_a_folder_that_takes_no_files_is_refused_before_the_flight():
    with pytest.raises(ConfigError, match="cannot be written"):
        prepare_route_folder(Path("/proc/self"))


def test_a_goal_is_written_whole_or_not_at_all(tmp_path):
    sidecar = sidecar_of(CAMERA, Mount(), None)
    with pytest.raises(ConfigError, match="cannot be written"):
        write_goal(tmp_path / "no" / "goal.png", picture(1.0), sidecar)
    assert list(tmp_path.iterdir()) == []
    write_goal(tmp_path / "goal.png", picture(1.0), sidecar)
    assert json.loads((tmp_path / "goal.json").read_text())["camera"]["width"] == CAMERA.width


def test_the_pictures_of_a_route_are_in_the_order_of_their_numbers(tmp_path):
    for name in ("10.png", "1000.png", "101.png", "2.png", "02.png"):
        (tmp_path / name).write_bytes(b"")
    names = [p.name for p in route_images([tmp_path])]
    assert names == ["02.png", "2.png", "10.png", "101.png", "1000.png"]
    assert [p.name for p in image_paths(str(tmp_path))] == names


def test_the_pictures_of_a_route_come_by_name_or_in_the_order_given(tmp_path):
    for name in ("b.png", "a.JPG", "c.json"):
        (tmp_path / name).write_bytes(b"")
    assert [p.name for p in route_images([tmp_path])] == ["a.JPG", "b.png"]
    assert [p.name for p in route_images([tmp_path / "b.png", tmp_path])] == [
        *("b.png", "a.JPG", "b.png")
    ]
    (tmp_path / "empty").mkdir()
    with pytest.raises(ConfigError, match="is empty"):
        route_images([tmp_path / "empty"])


@pytest.mark.parametrize("number", [signal.SIGINT, signal.SIGTERM])
def test_a_signal_ends_the_wait_for_the_vehicle(number, tmp_path, monkeypatch):
    def connect(*_):
        os.kill(os.getpid(), number)
        raise AssertionError("the wait goes on")

    monkeypatch.setattr(VehicleStateListener, "connect", connect)
    lens = ("--set", "camera.horizontal_fov_deg=75", "--set", "flow.model=classical")
    size = ("--set", "camera.width=320", "--set", "camera.height=240")
    with pytest.raises(SystemExit) as end:
        cli.main(["teach", "--out", str(tmp_path / "route"), *lens, *size])
    assert end.value.code == 128 + number


class Told:
    """Lines of a recording's progress, with the time in hand."""

    def __init__(self):
        self.lines, self.now_s = [], 0.0
        self.progress = RouteProgress("a/camera", self.lines.append, lambda: self.now_s)
        self.lines.clear()

    def frames(self, seconds, refusal="", event=Event.NOTHING):
        self._pass(seconds, lambda: self.progress.on_frame(event, 1, refusal))

    def silence(self, seconds):
        self._pass(seconds, self.progress.on_silence)

    def _pass(self, seconds, what):
        for _ in range(round(seconds * 4)):
            self.now_s += 0.25
            what()


def test_a_refusal_is_said_once_and_again_where_it_returns_or_changes():
    told = Told()
    told.frames(10.0, "black")
    told.frames(10.0, "white")
    told.frames(10.0)
    told.frames(10.0, "white")
    assert told.lines == [f"frames are refused: {why}" for why in ("black", "white", "white")]


def test_refusals_in_turns_are_no_more_than_one_line_in_two_seconds():
    told = Told()
    for _ in range(20):
        told.frames(0.25, "black")
        told.frames(0.25, "white")
    assert 1 <= len(told.lines) <= 6


def test_silence_is_said_after_two_seconds_and_once():
    told = Told()
    told.silence(1.75)
    assert told.lines == []
    told.silence(60.0)
    told.frames(1.0)
    told.silence(60.0)
    assert told.lines == ["no frames on a/camera: is the camera publishing?"] * 2


def test_a_goal_is_said_at_once_and_a_lost_one_every_two_seconds():
    told = Told()
    told.frames(0.25, event=Event.SAVED)
    told.frames(4.0, event=Event.LOST)
    assert told.lines[0] == "goal 1"
    assert len(told.lines) == 3
    assert all("out of sight" in line for line in told.lines[1:])
