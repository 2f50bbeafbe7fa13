"""Routes taught by frames of a box whose flow is known exactly."""

import json

import numpy as np
import pytest
from box_sight import CAMERA, CLOCK, MS, KnowingMatcher, picture

from dfvs_common.goal_file import write_goal
from dfvs_core.errors import ConfigError
from dfvs_core.messages.frame import Frame, PixelFormat, decode_frame, decode_header, encode_frame
from dfvs_core.messages.goal import Mount
from dfvs_core.messages.link import VehicleState
from dfvs_core.perception.route_recording import RouteRecordingLimits
from dfvs_service.frames import RawSample
from dfvs_service.perception.assembly import Clocks
from dfvs_service.route.goal_sidecar import sidecar_of
from dfvs_service.route.recording import (
    Event,
    RouteRecorder,
    prepare_route_folder,
    route_recording_settings,
)
from dfvs_service.settings.config import load_config
from dfvs_service.settings.goal_file import load_goal, route_images


def decoded(sample):
    return decode_frame(sample.payload, decode_header(sample.attachment))


class Rig:
    """A teacher with clock and vehicle in hand."""

    def __init__(self, folder):
        config = route_recording_settings(load_config(None, {}), CAMERA)
        self.now_ns = 5_000 * MS
        clocks = Clocks(CLOCK, lambda: self.now_ns, lambda: self.now_ns)
        limits = RouteRecordingLimits(overlap=0.5, turn_rad=0.35)
        self.teacher = RouteRecorder(config, folder, KnowingMatcher(), clocks, limits)
        self.seq = 0

    def state(self, yaw_deg):
        rest = (0.0, 0.0, 0.0)
        return VehicleState(self.now_ns, 0.02, -0.03, np.radians(yaw_deg), rest, rest)

    def frame(self, yaw_deg, *, heard=True):
        self.now_ns += 50 * MS
        if heard:
            self.teacher.on_vehicle_states([self.state(yaw_deg)])
        self.now_ns += 50 * MS
        if heard:
            self.teacher.on_vehicle_states([self.state(yaw_deg)])
        self.seq += 1
        image = picture(yaw_deg)
        image[1, 1] = self.seq % 251
        frame = Frame(image, self.now_ns, self.seq)
        sample = RawSample(*encode_frame(frame, PixelFormat.RGB8, CLOCK), self.now_ns)
        return self.teacher.process(sample, decoded)


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


def test_a_view_without_the_last_goal_is_lost_until_it_is_back(tmp_path):
    rig = Rig(tmp_path)
    rig.frame(10.0)
    assert rig.frame(12.0) is Event.NOTHING
    assert rig.frame(170.0) is Event.LOST
    assert rig.frame(14.0) is Event.NOTHING
    assert rig.frame(170.0) is Event.LOST
    assert rig.teacher.finish()
    assert headings(tmp_path) == [10.0, 14.0]


def test_a_folder_with_a_route_in_it_is_refused(tmp_path):
    prepare_route_folder(tmp_path / "new")
    write_goal(tmp_path / "new" / "001.png", picture(1.0), sidecar_of(CAMERA, Mount(), None))
    with pytest.raises(ConfigError, match="holds images already"):
        prepare_route_folder(tmp_path / "new")


def test_a_goal_is_written_whole_or_not_at_all(tmp_path):
    sidecar = sidecar_of(CAMERA, Mount(), None)
    with pytest.raises(ConfigError, match=r"ends in \.png"):
        write_goal(tmp_path / "goal.jpg", picture(1.0), sidecar)
    with pytest.raises(ConfigError, match="cannot be written"):
        write_goal(tmp_path / "no" / "goal.png", picture(1.0), sidecar)
    assert list(tmp_path.iterdir()) == []
    write_goal(tmp_path / "goal.png", picture(1.0), sidecar)
    assert json.loads((tmp_path / "goal.json").read_text())["camera"]["width"] == CAMERA.width


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
