"""The recorder's files, without a network: what is in them, how they end, and what is lost."""

import dataclasses
import itertools
import json

import numpy as np
import pytest
from foxglove_schemas_protobuf.CameraCalibration_pb2 import CameraCalibration
from foxglove_schemas_protobuf.CompressedImage_pb2 import CompressedImage
from foxglove_schemas_protobuf.FrameTransforms_pb2 import FrameTransforms
from foxglove_schemas_protobuf.ImageAnnotations_pb2 import ImageAnnotations
from foxglove_schemas_protobuf.Log_pb2 import Log
from foxglove_schemas_protobuf.PoseInFrame_pb2 import PoseInFrame
from foxglove_schemas_protobuf.PosesInFrame_pb2 import PosesInFrame
from full_disk import no_file_above
from mcap.reader import make_reader
from recorded_flight import CAMERA, fly, put

from dfvs_core.geometry.poses import rotation_from_quaternion
from dfvs_core.messages.frame import PixelFormat
from dfvs_core.messages.goal import Mount
from dfvs_core.messages.image import decode_image
from dfvs_core.perception.flow_grid import FlowGrid
from dfvs_service.record.cli import main as record_main
from dfvs_service.record.process import free_name
from dfvs_service.record.reading import RecordingError, recover
from dfvs_service.record.recorder import Recorder
from dfvs_service.replay.flight import Trial, replay
from dfvs_service.replay.recording import read_recording
from dfvs_service.report.recording import RecordedFlight
from dfvs_service.settings.record_sections import RecordSection

S = 1_000_000_000
ROOMY = RecordSection(min_free_mb=0.0)


@pytest.fixture(scope="module")
def flight():
    return fly(np.random.default_rng(7), frames=9)


@pytest.fixture(scope="module")
def large():
    """The same in raw pixels: a quarter of a megabyte a frame."""
    return fly(np.random.default_rng(7), 12, PixelFormat.RGB8)


class Desk:
    """A recorder with a clock in hand, and what it warned of."""

    def __init__(self, folder, section=ROOMY):
        self.folder = folder
        self.now_ns = 0
        self.warnings = []
        self.recorder = Recorder(folder, "r", section, lambda: self.now_ns, self.warnings.append)

    def take(self, events):
        for event in events:
            self.now_ns += S // 20
            put(self.recorder, *event)
        return self

    def record(self, events):
        """Take all events, and end the recording."""
        self.take(events).recorder.close()
        return self

    @property
    def files(self):
        return sorted(self.folder.glob("*.mcap"))


def messages(path, topic):
    with path.open("rb") as file:
        return [message.data for _, _, message in make_reader(file).iter_messages([topic])]


def told(paths, warnings=None):
    warn = print if warnings is None else warnings.append
    return [(entry.message, entry.payload) for entry in read_recording(paths, warn)]


def payloads(events):
    return [payload for message, payload in events if getattr(message, "sight", None)]


@pytest.mark.parametrize("pixel_format", [PixelFormat.JPEG, PixelFormat.RGB8, PixelFormat.MONO8])
def test_what_was_told_is_read_back_to_the_last_bit(tmp_path, pixel_format):
    flight = fly(np.random.default_rng(7), 5, pixel_format)
    desk = Desk(tmp_path).record(flight.events)
    back = told(desk.files)
    assert [message for message, _ in back] == [message for message, _ in flight.events]
    assert payloads(back) == payloads(flight.events)
    assert back[0][1] == flight.events[0][1]
    assert not desk.warnings


def test_flow_path_and_log_are_in_it_for_people_and_change_nothing_of_a_replay(tmp_path, flight):
    grid = FlowGrid(np.ones((4, 6, 2), np.float32), np.ones((4, 6), np.float32), 40, 1, 5 * S)
    desk = Desk(tmp_path)
    for event in flight.events:
        desk.recorder.add_flow(grid)  # before the opening there is no file for it
        desk.take([event])
    desk.recorder.close()
    (drawn,) = ImageAnnotations.FromString(messages(desk.files[0], "/camera/flow")[0]).points
    assert len(drawn.points) == 2 * 2 * 3
    (entry, *_) = [Log.FromString(data) for data in messages(desk.files[0], "/gate/log")]
    assert entry.message.startswith(flight.turns[0].heard[0].state)
    path = PosesInFrame.FromString(messages(desk.files[0], "/vehicle/path")[-1])
    assert path.poses[0].position.z == pytest.approx(-1.5)
    assert [message for message, _ in told(desk.files)] == [message for message, _ in flight.events]


def test_it_opens_with_foxglove_s_standard_schemas(tmp_path, flight):
    desk = Desk(tmp_path).record(flight.events)
    with desk.files[0].open("rb") as file:
        summary = make_reader(file).get_summary()
        notes = {note.name: note.metadata for note in make_reader(file).iter_metadata()}
    schemas = {
        channel.topic: summary.schemas[channel.schema_id].name
        for channel in summary.channels.values()
        if channel.schema_id
    }
    assert schemas["/camera/image"] == "foxglove.CompressedImage"
    assert schemas["/goal/image"] == "foxglove.CompressedImage"
    assert schemas["/camera/calibration"] == "foxglove.CameraCalibration"
    assert schemas["/vehicle/pose"] == "foxglove.PoseInFrame"
    assert schemas["/tf"] == "foxglove.FrameTransforms"
    assert notes["dfvs"]["vehicle"] == "bottled"
    assert notes["dfvs.model"]["name"] == "classical"
    assert len(notes["dfvs.build"]["source"]) == 64


def test_picture_pose_and_calibration_say_what_they_should(tmp_path, flight):
    desk = Desk(tmp_path).record(flight.events)
    (path,) = desk.files
    picture = CompressedImage.FromString(messages(path, "/camera/image")[0])
    assert picture.format == "jpeg"
    assert decode_image(picture.data).shape == (240, 320, 3)
    calibration = CameraCalibration.FromString(messages(path, "/camera/calibration")[0])
    assert (calibration.width, calibration.height) == CAMERA.size
    # Foxglove counts pixels from the first one's centre.
    np.testing.assert_allclose(
        calibration.K, [CAMERA.fx, 0, CAMERA.cx - 0.5, 0, CAMERA.fy, CAMERA.cy - 0.5, 0, 0, 1]
    )
    vehicle = flight.turns[0].heard[0].vehicle
    pose = PoseInFrame.FromString(messages(path, "/vehicle/pose")[0])
    position = pose.pose.position
    assert (position.x, position.y, position.z) == vehicle.position_m
    at_ns = pose.timestamp.seconds * S + pose.timestamp.nanos
    assert at_ns == vehicle.t_ns + flight.opening.unix_offset_ns
    setpoint = json.loads(messages(path, "/gate/setpoint")[0])
    assert setpoint == {"forward_m_s": 0, "right_m_s": 0.25, "down_m_s": 0, "yaw_rad_s": 0.01}


def test_the_camera_looks_ahead_in_a_world_whose_z_axis_is_up(tmp_path, flight):
    desk = Desk(tmp_path).record(flight.events)
    still, moving = messages(desk.files[0], "/tf")[:2]
    R = {}
    for transform in [
        *FrameTransforms.FromString(still).transforms,
        *FrameTransforms.FromString(moving).transforms,
    ]:
        q = transform.rotation
        names = transform.parent_frame_id, transform.child_frame_id
        R[names] = rotation_from_quaternion(np.array([q.w, q.x, q.y, q.z]))
    down = R["world", "ned"] @ [0, 0, 1]
    np.testing.assert_allclose(down, [0, 0, -1], atol=1e-12)
    ahead = R["world", "ned"] @ R["ned", "body"] @ R["body", "camera"] @ [0, 0, 1]
    yaw = flight.turns[0].heard[0].vehicle.yaw_rad
    np.testing.assert_allclose(ahead[:2], [np.sin(yaw), np.cos(yaw)], atol=2e-3)  # east, north
    np.testing.assert_allclose(R["body", "camera"], Mount().T_body_camera()[:3, :3], atol=1e-12)


def test_a_file_that_is_full_is_followed_by_another_which_opens_by_itself(tmp_path, large):
    size = 400_000
    desk = Desk(tmp_path, dataclasses.replace(ROOMY, max_file_mb=size / 1e6)).record(large.events)
    assert len(desk.files) > 2
    assert all(path.stat().st_size < 2.5 * size for path in desk.files)
    assert payloads(told(desk.files)) == payloads(large.events)
    alone = told(desk.files[1:2])
    assert alone[0][0] == large.opening
    assert alone[1][0].number > 0


def test_a_recording_that_is_too_large_loses_its_oldest_files_and_nothing_else(tmp_path, large):
    stranger = tmp_path / "another.mcap"
    stranger.write_bytes(b"not ours")
    desk = Desk(tmp_path, RecordSection(max_file_mb=0.3, max_total_mb=0.9, min_free_mb=0.0)).take(
        large.events
    )
    desk.recorder.close()
    assert desk.recorder.counts.files_removed > 0
    ours = [path for path in desk.files if path != stranger]
    assert sum(path.stat().st_size for path in ours) < 1_500_000
    assert told(ours)[-1][0] == large.turns[-1]
    assert stranger.exists()


def test_too_little_space_drops_and_says_so_and_goes_on_when_there_is_some(tmp_path, flight):
    desk = Desk(tmp_path, RecordSection(min_free_mb=1e12)).take(flight.events)
    counts = desk.recorder.counts
    assert counts.records == 0
    assert counts.dropped == len(flight.turns)
    assert "are free" in desk.warnings[0]
    assert len(desk.warnings) == 1
    assert not desk.files


def test_a_disk_that_is_full_never_stops_the_recorder(tmp_path, large):
    desk = Desk(tmp_path)
    with no_file_above(700_000):
        desk.take(large.events)
    counts = desk.recorder.counts
    assert counts.dropped > 0
    assert counts.records > 0
    assert any("File too large" in line for line in desk.warnings)
    lost = counts.dropped
    desk.now_ns += 6 * S  # it tries again after a while
    desk.take(itertools.islice(large.events, 1, 4))
    desk.recorder.close()
    assert counts.dropped == lost
    assert len(told(desk.files)) > 3


def test_turns_that_never_came_are_counted(tmp_path, flight):
    events = [*flight.events[:3], *flight.events[7:]]
    desk = Desk(tmp_path).take(events)
    assert desk.recorder.counts.missing == 4


def test_a_file_that_was_cut_short_keeps_all_but_its_last_chunk(tmp_path, large):
    """Whatever byte it ends at."""
    desk = Desk(tmp_path).record(large.events)
    (whole,) = desk.files
    data = whole.read_bytes()
    lengths = []
    for share in (0.999, 0.9, 0.613, 0.4):
        cut = tmp_path / "cut.mcap"
        cut.write_bytes(data[: int(share * len(data))])
        kept = told([cut])
        assert [m for m, _ in kept] == [m for m, _ in large.events[: len(kept)]]
        lengths.append(len(kept))
    assert lengths == sorted(lengths, reverse=True)
    assert lengths[0] == len(large.events)
    assert lengths[2] > 4


def test_a_file_that_was_cut_short_is_recovered(tmp_path, large):
    desk = Desk(tmp_path).record(large.events)
    (whole,) = desk.files
    cut, recovered = tmp_path / "cut.mcap", tmp_path / "recovered.mcap"
    cut.write_bytes(whole.read_bytes()[:-200_000])
    count = recover(cut, recovered, print)
    with recovered.open("rb") as file:
        assert make_reader(file).get_summary().statistics.message_count == count
    assert told([recovered]) == told([cut])
    with pytest.raises(RecordingError, match="exists"):
        recover(cut, recovered, print)


def test_a_repaired_copy_beside_its_original_is_left_out_and_named(tmp_path):
    flight = fly(np.random.default_rng(7), 8, next_goal_at=5)
    desk = Desk(tmp_path).record(flight.events)
    (original,) = desk.files
    assert record_main(["recover", str(original)]) == 0
    assert len(desk.files) == 2
    assert told(desk.files, warnings := []) == told([original])
    assert warnings == ["r-000-recovered.mcap: 8 frame records that other files hold are left out"]
    assert replay(desk.files, Trial(), lambda _: None).warnings == tuple(warnings)
    source = RecordedFlight(desk.files)
    assert source.name == "r"
    assert source.read().summary.told == (f"warning: {warnings[0]}",)


def test_two_recordings_of_one_second_get_names_of_their_own(tmp_path):
    names = []
    for _ in range(3):
        names.append(free_name(tmp_path, "r"))
        (tmp_path / f"{names[-1]}-000.mcap").touch()
    assert names == ["r", "r.2", "r.3"]


@pytest.mark.parametrize("content", [b"", b"no recording at all", b"\x89MCAP0\r\n"])
def test_what_is_no_recording_is_refused(tmp_path, content):
    path = tmp_path / "x.mcap"
    path.write_bytes(content)
    with pytest.raises(RecordingError, match=r"x\.mcap"):
        told([path])
