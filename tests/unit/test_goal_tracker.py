"""Which guess leads to the goal, and when nothing does."""

from dataclasses import dataclass, field

import numpy as np
import pytest

from dfvs_core.camera import CameraModel
from dfvs_core.correspondence import DepthMap, FlowField
from dfvs_core.goal_tracker import GUESS_NS, PASS_OVER_NS, TRIED_NS, GoalTracker, GoodLook
from dfvs_core.matching.matcher import Prepared
from dfvs_core.poses import make_pose

CAMERA = CameraModel.from_horizontal_fov(64, 48, np.radians(90))
STRIDE = 8
FRAME_NS = 50_000_000
WALL_M = 2.0
FRAME, GOAL = Prepared((48, 64)), Prepared((48, 64))
DEPTH = DepthMap(np.full((6, 8), WALL_M, np.float32), np.ones((6, 8), np.float32))


def flow(du_px, share=0.3):
    confidence = np.zeros((48, 64), np.float32)
    confidence[: round(48 * share)] = 1.0
    return FlowField(np.full((48, 64, 2), (du_px, 0.0), np.float32), confidence)


@dataclass
class Matcher:
    """Follows guesses that it holds for good, and notes what it was asked for."""

    holds: list[bool]
    share: float = 0.3
    guesses: list[float | None] = field(default_factory=list)
    starts: list[float | None] = field(default_factory=list)
    """What the searches began from."""

    @property
    def searches(self):
        return len(self.starts)

    def track(self, current, other, guess):
        self.guesses.append(float(np.median(guess.flow[..., 0])))
        return flow(self.guesses[-1], self.share) if self.holds.pop(0) else None

    def match(self, current, other, guess=None):
        self.starts.append(None if guess is None else float(np.median(guess.flow[..., 0])))
        return flow(99.0)


def moved(right_m):
    return make_pose(np.eye(3), [right_m, 0.0, 0.0])


def tracker(matcher, seen=None):
    """The goal lies 0.5 m to the right of the first frame: 8 px of flow to the left."""
    tracker = GoalTracker(matcher, GOAL, CAMERA, CAMERA, STRIDE)
    tracker.remember(GoodLook(0, seen or flow(-7.0), moved(-0.5), moved(0.0)))
    return tracker


def test_the_last_flow_is_tried_first():
    matcher = Matcher([True])
    found = tracker(matcher).match(FRAME, FRAME_NS, moved(0.0), DEPTH)
    assert (matcher.guesses, matcher.searches) == ([-7.0], 0)
    assert found.confidence.any()


def test_pose_and_depth_foretell_the_flow_for_the_way_since():
    matcher = Matcher([False, True])
    tracker(matcher).match(FRAME, FRAME_NS, moved(0.25), DEPTH)
    pixels = (-0.5 + 0.25) / WALL_M * CAMERA.fx
    assert matcher.guesses == [-7.0, pytest.approx(pixels, abs=0.01)]


def test_one_frame_that_does_not_follow_is_nothing_and_a_second_one_is_searched():
    matcher = Matcher([False] * 4)
    eye = tracker(matcher)
    nothing = eye.match(FRAME, FRAME_NS, moved(0.0), DEPTH)
    assert not nothing.confidence.any()
    assert matcher.searches == 0
    eye.remember(None)
    eye.match(FRAME, 2 * FRAME_NS, moved(0.0), DEPTH)
    assert matcher.searches == 1


@pytest.mark.parametrize(("t_ns", "searches"), [(PASS_OVER_NS, 0), (PASS_OVER_NS + 1, 1)])
def test_a_slow_camera_leaves_no_time_to_pass_a_frame_over(t_ns, searches):
    matcher = Matcher([False] * 2)
    tracker(matcher).match(FRAME, t_ns, moved(0.0), DEPTH)
    assert matcher.searches == searches


def test_a_goal_that_is_seen_again_may_be_missed_once_again():
    matcher = Matcher([False] * 4)
    eye = tracker(matcher)
    eye.remember(None)
    eye.remember(GoodLook(FRAME_NS, flow(-7.0), moved(-0.5), moved(0.0)))
    eye.match(FRAME, 2 * FRAME_NS, moved(0.0), DEPTH)
    assert matcher.searches == 0


@pytest.mark.parametrize(("t_ns", "tracked"), [(TRIED_NS, 1), (TRIED_NS + 1, 0)])
def test_a_look_is_tried_for_a_while_only(t_ns, tracked):
    """As long as a search takes on a slow computer, or it would search for ever."""
    matcher = Matcher([True])
    tracker(matcher).match(FRAME, t_ns, moved(0.0), DEPTH)
    assert (len(matcher.guesses), matcher.searches) == (tracked, 1 - tracked)


@pytest.mark.parametrize(("t_ns", "start"), [(GUESS_NS, -7.0), (GUESS_NS + 1, None)])
def test_a_search_goes_by_a_recent_look_only(t_ns, start):
    matcher = Matcher([False, False])
    eye = tracker(matcher)
    eye.remember(None)
    eye.match(FRAME, t_ns, moved(0.0), DEPTH)
    assert matcher.starts == [start]


def test_after_two_searches_by_the_last_look_one_goes_by_nothing():
    matcher = Matcher([False] * 6)
    eye = tracker(matcher)
    for k in range(3):
        eye.remember(None)
        eye.match(FRAME, k * FRAME_NS, moved(0.0), None)
    assert matcher.starts == [-7.0, -7.0, None]
    eye.remember(GoodLook(3 * FRAME_NS, flow(-5.0), moved(-0.5), moved(0.0)))
    eye.remember(None)
    eye.match(FRAME, 4 * FRAME_NS, moved(0.0), None)
    assert matcher.starts[-1] == -5.0


def test_a_frame_long_after_a_look_is_searched_at_once():
    matcher = Matcher([False, False])
    tracker(matcher).match(FRAME, GUESS_NS + 1, moved(0.0), DEPTH)
    assert matcher.starts == [None]


def test_without_a_look_everything_is_searched():
    matcher = Matcher([])
    GoalTracker(matcher, GOAL, CAMERA, CAMERA, STRIDE).match(FRAME, 0, moved(0.0), None)
    assert matcher.searches == 1


@pytest.mark.parametrize(("share", "next_guess_px"), [(0.4, -8.0), (0.2, -7.0)])
def test_the_surer_flow_leads_on(share, next_guess_px):
    matcher = Matcher([True, True], share)
    eye = tracker(matcher)
    assert eye.reconsider(FRAME, 0, DEPTH)
    eye.match(FRAME, FRAME_NS, moved(0.0), DEPTH)
    assert matcher.guesses[0] == pytest.approx(-8.0, abs=0.01)
    assert matcher.guesses[1] == pytest.approx(next_guess_px, abs=0.01)


@pytest.mark.parametrize(("share", "t_ns"), [(0.5, 0), (0.3, FRAME_NS)])
def test_what_is_clear_or_past_is_not_reconsidered(share, t_ns):
    matcher = Matcher([])
    assert not tracker(matcher, flow(-7.0, share)).reconsider(FRAME, t_ns, DEPTH)
