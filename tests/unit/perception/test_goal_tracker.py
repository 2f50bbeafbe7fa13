"""States of the goal tracker: what is tracked, what is relocalised, and what is excluded."""

from dataclasses import dataclass, field

import numpy as np
import pytest

from dfvs_core.depth.depth_map import DepthMap
from dfvs_core.geometry.camera import CameraModel
from dfvs_core.geometry.poses import make_pose
from dfvs_core.matching.correspondence import FlowField, confident_ratio
from dfvs_core.matching.matcher import ImageFeatures
from dfvs_core.messages.goal import GoalSidecar
from dfvs_core.perception.goal_tracker import GoalTracker, Observation, TrackingState
from dfvs_core.servo.config import ServoConfig
from dfvs_core.servo.task import ServoTask

CAMERA = CameraModel.from_horizontal_fov(64, 48, np.radians(90))
STRIDE = 8
MS = 1_000_000
FRAME_NS = 50 * MS
WALL_M = 2.0
FRAME, GOAL = ImageFeatures((48, 64)), ImageFeatures((48, 64))
DEPTH = DepthMap(np.full((6, 8), WALL_M, np.float32), np.ones((6, 8), np.float32))
STATES = TrackingState


def flow(du_px, share=0.3):
    confidence = np.zeros((48, 64), np.float32)
    confidence[: round(48 * share)] = 1.0
    return FlowField(np.full((48, 64, 2), (du_px, 0.0), np.float32), confidence)


def du(field):
    return float(np.median(field.flow[..., 0]))


@dataclass
class Matcher:
    """Tracks the predictions that it is told to, and notes what it was asked for."""

    holds: list[bool]
    share: float = 0.3
    """Confident share of the image in what is tracked."""
    extended: FlowField | None = None
    predictions: list[float] = field(default_factory=list)
    excluded: list[list[float]] = field(default_factory=list)
    """What each relocalisation was to exclude."""

    @property
    def relocalisations(self):
        return len(self.excluded)

    def track(self, current, other, predicted):
        self.predictions.append(du(predicted))
        return flow(self.predictions[-1], self.share) if self.holds.pop(0) else None

    def extend(self, current, other, known):
        return self.extended

    def match(self, current, other, *, excluded=()):
        self.excluded.append([du(wrong) for wrong in excluded])
        return flow(99.0)


def about_down(angle_rad):
    """Turn of a camera that stays level, y down."""
    c, s = np.cos(angle_rad), np.sin(angle_rad)
    return np.array([[c, 0.0, s], [0.0, 1.0, 0.0], [-s, 0.0, c]])


def moved(right_m):
    return make_pose(np.eye(3), [right_m, 0.0, 0.0])


def observation(t_ns=0, seen=None, right_m=0.0):
    """The goal lies 0.5 m to the right: 8 px of flow to the left."""
    return Observation(t_ns, seen or flow(-7.0), moved(-0.5), moved(right_m))


def unobserved(matcher):
    task = ServoTask(ServoConfig(stride_px=STRIDE), CAMERA, GoalSidecar(CAMERA))
    return GoalTracker(matcher, GOAL, task)


def tracker(matcher, seen=None):
    """A tracker that has observed the goal at time 0."""
    made = unobserved(matcher)
    made.update(observation(seen=seen))
    return made


def test_the_last_flow_is_tried_first():
    matcher = Matcher([True])
    made = tracker(matcher)
    found = made.match(FRAME, FRAME_NS, moved(0.0), DEPTH)
    assert (matcher.predictions, matcher.relocalisations) == ([-7.0], 0)
    assert found.confidence.any()
    assert made.state is STATES.TRACKING


def test_where_it_does_not_hold_pose_and_depth_predict_the_flow_for_the_motion_since():
    matcher = Matcher([False, True])
    made = tracker(matcher)
    made.match(FRAME, FRAME_NS, moved(0.25), DEPTH)
    pixels = (-0.5 + 0.25) / WALL_M * CAMERA.fx
    assert matcher.predictions == [-7.0, pytest.approx(pixels, abs=0.01)]
    assert (made.state, matcher.relocalisations) == (STATES.TRACKING, 0)


def test_without_depth_only_the_last_flow_is_tried():
    matcher = Matcher([False])
    tracker(matcher).match(FRAME, FRAME_NS, moved(0.25), None)
    assert matcher.predictions == [-7.0]


def test_one_frame_coasts_the_next_is_lost_and_those_after_it_are_searched():
    matcher = Matcher([False] * 8)
    made = tracker(matcher)
    found, states = [], []
    for k in range(1, 5):
        found.append(made.match(FRAME, k * FRAME_NS, moved(0.0), DEPTH))
        made.update(None)
        states.append(made.state)
    assert states == [STATES.COASTING, STATES.LOST, STATES.SEARCHING, STATES.SEARCHING]
    assert found[0].confidence.max() == 0.0
    assert found[0].confidence.shape == FRAME.size
    assert [du(each) for each in found[1:]] == [99.0] * 3
    assert len(matcher.predictions) == 8  # while searching, the last observation is tried as well


@pytest.mark.parametrize(("rate_hz", "state"), [(7, STATES.COASTING), (6, STATES.LOST)])
def test_a_camera_with_a_low_rate_does_not_coast(rate_hz, state):
    matcher = Matcher([False] * 2)
    made = tracker(matcher)
    made.match(FRAME, 1_000_000_000 // rate_hz, moved(0.0), DEPTH)
    assert made.state is state
    assert matcher.relocalisations == int(state is STATES.LOST)


@pytest.mark.parametrize("frames", [1, 2, 3])
def test_an_observation_leads_back_to_tracking_and_one_frame_may_coast_again(frames):
    matcher = Matcher([False] * 9)
    made = tracker(matcher)
    for k in range(1, frames + 1):
        made.match(FRAME, k * FRAME_NS, moved(0.0), DEPTH)
    made.update(observation(frames * FRAME_NS))
    assert made.state is STATES.TRACKING
    made.match(FRAME, (frames + 1) * FRAME_NS, moved(0.0), DEPTH)
    assert made.state is STATES.COASTING


def test_a_frame_without_an_observation_keeps_the_last_one():
    matcher = Matcher([False] * 2 + [True])
    made = tracker(matcher)
    made.match(FRAME, FRAME_NS, moved(0.0), DEPTH)
    made.update(None)
    made.match(FRAME, 2 * FRAME_NS, moved(0.0), DEPTH)
    assert matcher.predictions[2] == -7.0


def test_a_track_that_gives_no_observation_is_relocalised_in_every_fourth_frame():
    matcher = Matcher([True] * 8)
    made = tracker(matcher)
    done = []
    for k in range(1, 9):
        made.match(FRAME, k * FRAME_NS, moved(0.0), None)
        made.update(None)
        done.append(matcher.relocalisations)
    assert done == [0, 0, 0, 1, 1, 1, 1, 2]


def test_a_track_that_gives_an_observation_now_and_then_is_not_relocalised():
    matcher = Matcher([True] * 12)
    made = tracker(matcher)
    for k in range(1, 13):
        made.match(FRAME, k * FRAME_NS, moved(0.0), None)
        made.update(observation(k * FRAME_NS) if k % 3 == 0 else None)
    assert matcher.relocalisations == 0


def test_a_frame_that_is_tracked_again_coasts_no_more():
    made = tracker(Matcher([False, True]))
    made.match(FRAME, FRAME_NS, moved(0.0), None)
    assert made.state is STATES.COASTING
    made.match(FRAME, 2 * FRAME_NS, moved(0.0), None)
    assert made.state is STATES.TRACKING


@pytest.mark.parametrize(("age_s", "tracked"), [(5.0, 1), (5.1, 0)])
def test_an_observation_is_tracked_for_five_seconds(age_s, tracked):
    matcher = Matcher([True])
    tracker(matcher).match(FRAME, round(age_s * 1e9), moved(0.0), DEPTH)
    assert (len(matcher.predictions), matcher.relocalisations) == (tracked, 1 - tracked)


def test_without_an_observation_a_frame_is_relocalised():
    matcher = Matcher([])
    made = unobserved(matcher)
    assert made.state is STATES.SEARCHING
    found = made.match(FRAME, 0, moved(0.0), None)
    assert (matcher.relocalisations, du(found)) == (1, 99.0)
    assert made.state is STATES.SEARCHING


LATER_NS = 2_000_000_000


def extended(made, t_ns=LATER_NS):
    """A tracker that looked for more in a frame where it had looked long ago; the two steps."""
    made.update(observation(t_ns))
    assert made.extend(FRAME, t_ns)
    assert made.extend(FRAME, t_ns + FRAME_NS)
    assert not made.extend(FRAME, t_ns + 2 * FRAME_NS)
    return made


@pytest.mark.parametrize(("share", "next_px"), [(0.4, -8.0), (0.2, -7.0)])
def test_an_extension_leads_on_if_it_is_confident_in_more_of_the_image(share, next_px):
    matcher = Matcher([True], extended=flow(-8.0, share))
    made = extended(tracker(matcher))
    made.match(FRAME, LATER_NS + FRAME_NS, moved(0.0), DEPTH)
    assert matcher.predictions == [next_px]


@pytest.mark.parametrize(("age_ms", "next_px"), [(300, -8.0), (350, -7.0)])
def test_an_extension_that_comes_late_leads_no_frame(age_ms, next_px):
    matcher = Matcher([True], extended=flow(-8.0, 0.4))
    made = tracker(matcher)
    made.update(observation(LATER_NS))
    assert not made.is_extending
    assert made.extend(FRAME, LATER_NS)
    assert made.is_extending
    now_ns = LATER_NS + age_ms * MS
    made.update(observation(now_ns))
    assert made.extend(FRAME, now_ns)
    made.match(FRAME, now_ns + FRAME_NS, moved(0.0), None)
    assert matcher.predictions == [next_px]


def test_where_nothing_else_matches_the_last_flow_leads_on():
    matcher = Matcher([True])
    made = extended(tracker(matcher))
    made.match(FRAME, LATER_NS + FRAME_NS, moved(0.0), DEPTH)
    assert matcher.predictions == [-7.0]


def test_more_is_looked_for_once_a_second_at_most():
    made = extended(tracker(Matcher([])))
    for t_ns, is_due in ((LATER_NS + 950 * MS, False), (LATER_NS + 1000 * MS, True)):
        made.update(observation(t_ns))
        assert made.extend(FRAME, t_ns) == is_due


@pytest.mark.parametrize(("share", "t_ns"), [(0.5, 0), (0.3, FRAME_NS)], ids=["clear", "past"])
def test_a_goal_that_is_clear_or_of_a_past_frame_is_not_extended(share, t_ns):
    made = unobserved(Matcher([]))
    made.update(observation(LATER_NS, flow(-7.0, share)))
    assert not made.extend(FRAME, LATER_NS + t_ns)


def test_more_is_not_looked_for_soon_after_a_relocalisation():
    made = unobserved(Matcher([]))
    made.match(FRAME, LATER_NS, moved(0.0), DEPTH)
    for t_ns, is_due in ((LATER_NS + 950 * MS, False), (LATER_NS + 1000 * MS, True)):
        made.update(observation(t_ns))
        assert made.extend(FRAME, t_ns) == is_due


def test_a_goal_that_was_not_observed_is_not_extended():
    assert not unobserved(Matcher([])).extend(FRAME, LATER_NS)


def test_what_is_rejected_meanwhile_is_not_extended():
    matcher = Matcher([], extended=flow(-8.0, 0.9))
    made = tracker(matcher)
    made.update(observation(LATER_NS))
    assert made.extend(FRAME, LATER_NS)
    made.reject(was_flown_to=False)
    assert not made.extend(FRAME, LATER_NS + FRAME_NS)


class Held(ImageFeatures):
    """Knows whether it was released."""

    released = False

    def release(self):
        self.released = True


def test_a_frame_keeps_what_its_extension_needs():
    frame = Held((48, 64))
    made = tracker(Matcher([]))
    made.update(observation(LATER_NS))
    assert made.extend(frame, LATER_NS)
    made.release(frame)
    assert not frame.released
    assert made.extend(FRAME, LATER_NS + FRAME_NS)
    assert frame.released


def test_other_frames_are_released():
    frame = Held((48, 64))
    tracker(Matcher([])).release(frame)
    assert frame.released


@pytest.mark.parametrize("was_flown_to", [True, False])
def test_a_rejected_goal_is_neither_tracked_nor_extended(was_flown_to):
    matcher = Matcher([])
    made = tracker(matcher)
    made.reject(was_flown_to)
    assert made.state is STATES.SEARCHING
    assert not made.extend(FRAME, LATER_NS)
    found = made.match(FRAME, FRAME_NS, moved(0.0), DEPTH)
    assert (matcher.predictions, matcher.excluded) == ([], [[]])
    assert confident_ratio(found) > 0.0


def reject(made, times, right_m=0.0):
    """The goal was observed 0.5 m to the right of there, and was false."""
    for _ in range(times):
        made.update(observation(right_m=right_m))
        made.update(None)
        made.reject(was_flown_to=True)


def test_a_goal_that_was_false_twice_is_excluded_from_a_relocalisation():
    matcher = Matcher([])
    made = unobserved(matcher)
    reject(made, 1)
    made.match(FRAME, FRAME_NS, moved(0.0), DEPTH)
    reject(made, 1)
    made.match(FRAME, FRAME_NS, moved(0.0), DEPTH)
    made.update(Observation(0, flow(5.0), moved(0.3), moved(0.0)))
    made.reject(was_flown_to=True)
    made.match(FRAME, FRAME_NS, moved(0.25), DEPTH)  # on the way from there
    ahead_px = -CAMERA.fx / WALL_M
    expected = [[], [0.5 * ahead_px], [0.25 * ahead_px]]
    for found, wanted in zip(matcher.excluded, expected, strict=True):
        assert found == pytest.approx(wanted, abs=0.01)


def test_without_depth_nothing_is_excluded():
    matcher = Matcher([])
    made = unobserved(matcher)
    reject(made, 2)
    made.match(FRAME, FRAME_NS, moved(0.0), None)
    assert matcher.excluded == [[]]


def test_where_nothing_else_is_found_every_other_relocalisation_excludes_nothing():
    matcher = Matcher([])
    made = unobserved(matcher)
    reject(made, 2)
    for _ in range(4):
        made.match(FRAME, FRAME_NS, moved(0.0), DEPTH)
        made.update(None)
    assert [len(excluded) for excluded in matcher.excluded] == [1, 0, 1, 0]


def test_two_goals_that_were_false_once_are_not_excluded():
    matcher = Matcher([])
    made = unobserved(matcher)
    reject(made, 1)
    reject(made, 1, right_m=0.4)
    made.match(FRAME, FRAME_NS, moved(0.0), DEPTH)
    assert matcher.excluded == [[]]


def test_two_false_goals_that_face_another_way_are_not_one():
    matcher = Matcher([])
    made = unobserved(matcher)
    for turn_rad in (0.0, 0.4):
        made.update(
            Observation(0, flow(-7.0), moved(-0.5), make_pose(about_down(turn_rad), [0, 0, 0]))
        )
        made.reject(was_flown_to=True)
    made.match(FRAME, FRAME_NS, moved(0.0), DEPTH)
    assert matcher.excluded == [[]]


@pytest.mark.parametrize(("age_s", "excluded"), [(30, 1), (31, 0)])
def test_a_rejection_expires_after_half_a_minute(age_s, excluded):
    matcher = Matcher([])
    made = unobserved(matcher)
    reject(made, 2)
    made.match(FRAME, age_s * 1_000_000_000, moved(0.0), DEPTH)
    assert len(matcher.excluded[0]) == excluded


def test_a_false_goal_that_was_not_flown_to_is_not_excluded():
    """Before a flight somebody may stand in front of the goal for as long as they like."""
    matcher = Matcher([])
    made = unobserved(matcher)
    for _ in range(2):
        made.update(observation())
        made.reject(was_flown_to=False)
    made.match(FRAME, FRAME_NS, moved(0.0), DEPTH)
    assert matcher.excluded == [[]]
