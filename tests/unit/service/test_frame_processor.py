"""What perception makes of raw samples, with a matcher that knows the answer."""

import numpy as np
import pytest
from still_pipeline import StillMatcher, pipeline

from dfvs_core.geometry.camera import CameraModel
from dfvs_core.matching.correspondence import FlowField
from dfvs_core.messages.frame import Frame, PixelFormat, encode_frame
from dfvs_core.messages.link import GateStatus, VehicleState
from dfvs_service.frames import RawSample
from dfvs_service.perception.frame_processor import FrameProcessor

CAMERA = CameraModel.from_horizontal_fov(160, 120, 1.3)
MS = 1_000_000
CLOCK = b"c" * 16
BLACK = np.zeros((120, 160, 3), np.uint8)


class Rig:
    """An eye with a clock in hand."""

    def __init__(self, rng, **settings):
        self.now_ns = 5_000 * MS
        self.picture = rng.integers(0, 255, (120, 160, 3)).astype(np.uint8)
        self.seq = 0
        self.matcher = StillMatcher()
        perception = pipeline(self.picture, self.matcher, lambda: self.now_ns, **settings)
        self.eye = FrameProcessor(CAMERA, perception, CLOCK, lambda: self.now_ns)

    def hear_vehicle(self, state="SERVO", east_m=0.0):
        for back_ms in (60, 40, 20, 0):
            t_ns = self.now_ns - back_ms * MS
            vehicle = VehicleState(t_ns, 0.0, 0.0, 0.0, (0.0, 0.0, 0.0), (0.0, east_m, 0.0))
            self.eye.on_gate_status(GateStatus(state, "", vehicle))

    def sample(self, image=None, t_ns=None, pixel_format=PixelFormat.RGB8, clock=CLOCK):
        self.seq += 1
        self.now_ns += 50 * MS
        image = self.picture if image is None else image
        frame = Frame(image, self.now_ns - 5 * MS if t_ns is None else t_ns, self.seq)
        payload, attachment = encode_frame(frame, pixel_format, clock)
        return RawSample(payload, attachment, self.now_ns)

    def process(self, t_ns=None, **vehicle):
        """Process a frame that differs from the one before, as a live camera's frames do."""
        image = self.picture.copy()
        image[0, 0] = self.seq
        sample = self.sample(image, t_ns)
        self.hear_vehicle(**vehicle)
        return self.eye.process(sample)


@pytest.fixture
def rig(rng):
    return Rig(rng)


def test_a_good_frame_becomes_a_healthy_report(rig):
    glance = rig.process()
    assert glance.report.healthy
    assert glance.report.t_capture_ns == rig.now_ns - 5 * MS
    assert glance.stages_ns["transport"] == 5 * MS


def test_a_vehicle_that_stays_at_the_goal_has_reached_it_after_the_stop_rule_s_second(rig):
    reached = [rig.process().report.reached for _ in range(24)]
    assert not any(reached[:18])  # 50 ms a frame: by then the window of 1 s is not full
    assert reached[-1]


@pytest.mark.parametrize(("between", "is_lost"), [("SERVO", True), ("HOLD", True), ("DONE", False)])
def test_a_hold_does_not_begin_the_time_in_which_the_error_must_fall_anew(rng, between, is_lost):
    shift = np.zeros((120, 160, 2), np.float32)
    shift[..., 0] = 40.0
    rig = Rig(rng)
    rig.matcher.flow = FlowField(shift, np.ones((120, 160), np.float32))
    states = ["SERVO"] * 60 + [between] * 20 + ["SERVO"] * 80
    lost = [rig.process(state=state).report.lost for state in states]
    assert any(lost) is is_lost
    assert not any(lost[:100])


def test_nothing_is_relocalised_after_a_report(rig):
    rig.matcher.share = 0.2
    assert rig.process().report.healthy
    before = rig.matcher.relocalisations
    rig.eye.pipeline.work_between_frames()
    assert rig.matcher.relocalisations == before


def test_more_of_a_goal_in_a_part_of_the_view_is_looked_for_after_reports(rng):
    rig = Rig(rng, min_matched_texture=0.0)
    rig.matcher.share = 0.2
    for k in range(46):
        assert rig.process().report.healthy
        before = rig.matcher.extensions
        rig.eye.pipeline.work_between_frames()
        assert rig.matcher.extensions - before == (k in (21, 41))  # a frame after 1 and 2 s


def test_frames_that_were_long_on_the_way_do_not_count_as_late(rng):
    """Depth is learnt in every fourth frame, 50 ms apart, though each is 60 ms old."""
    rig, learnt = Rig(rng, depth="motion"), []
    for k in range(16):
        assert rig.process(rig.now_ns - 10 * MS, east_m=0.02 * k).report.healthy
        before = len(rig.matcher.predictions)
        rig.eye.pipeline.work_between_frames()
        if len(rig.matcher.predictions) > before:
            learnt.append(k)
    assert set(np.diff(learnt)) == {4}


def test_without_the_vehicle_s_attitude_nothing_is_flown(rig):
    report = rig.eye.process(rig.sample()).report
    assert not report.healthy
    assert "attitude" in report.reason


def cut_short(rig):
    good = rig.sample(pixel_format=PixelFormat.JPEG)
    return RawSample(good.payload[:50], good.attachment, good.t_arrival_ns)


@pytest.mark.parametrize(
    ("make", "reason"),
    [
        (lambda rig: rig.sample(np.zeros((60, 80, 3), np.uint8)), "size"),
        (lambda rig: rig.sample(BLACK), "black"),
        (lambda rig: rig.sample(t_ns=rig.now_ns - 400 * MS), "old"),
        (lambda rig: rig.sample(t_ns=rig.now_ns + 900 * MS), "still to come"),
        (lambda rig: RawSample(b"x" * 99, b"", rig.now_ns), "attachment"),
        (cut_short, "checksum"),
        (lambda rig: rig.sample(clock=b"z" * 16), "another machine"),
    ],
)
def test_a_bad_frame_becomes_an_unhealthy_report_with_its_reason(rig, make, reason):
    sample = make(rig)
    rig.hear_vehicle()
    report = rig.eye.process(sample).report
    assert not report.healthy
    assert reason in report.reason
    assert report.velocity == (0.0, 0.0, 0.0, 0.0)
    assert rig.eye.refused == 1


def test_a_frozen_camera_is_noticed_at_the_third_picture(rig):
    healthy = []
    for _ in range(4):
        sample = rig.sample()
        rig.hear_vehicle()
        healthy.append(rig.eye.process(sample).report.healthy)
    assert healthy == [True, True, False, False]


def test_a_good_frame_after_bad_ones_is_flown_again(rig):
    rig.eye.process(rig.sample(BLACK))
    assert rig.process().report.healthy
