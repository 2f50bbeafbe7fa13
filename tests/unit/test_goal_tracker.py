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
    besides: list[list[float]] = field(default_factory=list)
    """What the searches were to pass over."""

    @property
    def searches(self):
        return len(self.starts)

    def track(self, current, other, guess):
        self.guesses.append(float(np.median(guess.flow[..., 0])))
        return flow(self.guesses[-1], self.share) if self.holds.pop(0) else None

    def match(self, current, other, guess=None, *, besides=()):
        self.starts.append(None if guess is None else float(np.median(guess.flow[..., 0])))
        self.besides.append([float(np.median(wrong.flow[..., 0])) for wrong in besides])
        return flow(99.0)


def about_down(angle_rad):
    """Turn of a camera that stays level, y down."""
    c, s = np.cos(angle_rad), np.sin(angle_rad)
    return np.array([[c, 0.0, s], [0.0, 1.0, 0.0], [-s, 0.0, c]])


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


class Finding(Matcher):
    """Finds the same flow in each search, in another part of the picture."""

    def __init__(self, du_px):
        super().__init__([True] * 9)
        self.du_px = du_px

    def match(self, current, other, guess=None, *, besides=()):
        found = flow(self.du_px, 0.1)
        self.starts.append(None)
        found.confidence[10 : 10 + 4 * self.searches] = 1.0
        return found


def share_after_looking_again(matcher, first, times):
    eye = tracker(matcher, first)
    tried = [eye.look_again(FRAME, 0) for _ in range(times)]
    eye.match(FRAME, FRAME_NS, moved(0.0), DEPTH)
    return eye, tried, float(np.mean(eye._last.flow.confidence))


def test_what_another_search_finds_of_the_same_adds_to_a_scant_first_look():
    _, tried, share = share_after_looking_again(Finding(-7.0), flow(-7.0, 0.1), 2)
    assert tried == [True, True]
    assert share > 0.2


def test_what_another_search_finds_elsewhere_adds_nothing():
    _, tried, share = share_after_looking_again(Finding(9.0), flow(-7.0, 0.1), 1)
    assert tried == [True]
    assert share == pytest.approx(0.1, abs=0.02)


def test_a_clear_first_look_is_enough():
    matcher = Finding(-7.0)
    assert share_after_looking_again(matcher, flow(-7.0, 0.3), 1)[1] == [False]
    assert matcher.searches == 0


def test_it_looks_again_a_few_times_and_as_often_after_a_search():
    matcher = Matcher([False] * 9)
    matcher.match = lambda *_, besides=(): flow(50.0, 0.1)  # never agrees
    eye, tried, _ = share_after_looking_again(matcher, flow(-7.0, 0.1), 6)
    assert tried == [True] * 4 + [False] * 2
    late_ns = TRIED_NS + FRAME_NS
    eye.match(FRAME, late_ns, moved(0.0), DEPTH)
    eye.remember(GoodLook(late_ns, flow(50.0, 0.1), moved(-0.5), moved(0.0)))
    assert eye.look_again(FRAME, late_ns)


def test_only_the_last_frame_is_looked_at_again():
    assert not tracker(Finding(-7.0), flow(-7.0, 0.1)).look_again(FRAME, FRAME_NS)


def mistaken(eye, times, right_m=0.0):
    """The goal was taken to be 0.5 m to the right of there, and was not."""
    for _ in range(times):
        eye.remember(GoodLook(0, flow(-7.0), moved(-0.5), moved(right_m)))
        eye.remember(None)
        eye.forget(is_wrong=True)


def test_a_place_that_was_a_mistake_twice_is_passed_over_in_a_search():
    matcher = Matcher([])
    eye = tracker(matcher)
    mistaken(eye, 1)
    eye.match(FRAME, FRAME_NS, moved(0.0), DEPTH)
    mistaken(eye, 1)
    eye.match(FRAME, FRAME_NS, moved(0.0), DEPTH)
    eye.remember(GoodLook(0, flow(5.0), moved(0.3), moved(0.0)))
    eye.forget(is_wrong=True)
    eye.match(FRAME, FRAME_NS, moved(0.25), DEPTH)  # on the way from there
    assert matcher.starts == [None] * 3
    ahead_px = -CAMERA.fx / WALL_M
    expected = [[], [0.5 * ahead_px], [0.25 * ahead_px]]
    for found, wanted in zip(matcher.besides, expected, strict=True):
        assert found == pytest.approx(wanted, abs=0.01)


def test_where_nothing_else_is_found_every_other_search_passes_over_nothing():
    matcher = Matcher([])
    eye = tracker(matcher)
    mistaken(eye, 2)
    for _ in range(4):
        eye.match(FRAME, FRAME_NS, moved(0.0), DEPTH)
        eye.remember(None)
    assert [len(besides) for besides in matcher.besides] == [1, 0, 1, 0]


def test_two_places_that_were_a_mistake_once_are_none_yet():
    matcher = Matcher([])
    eye = tracker(matcher)
    mistaken(eye, 1)
    mistaken(eye, 1, right_m=0.4)
    eye.match(FRAME, FRAME_NS, moved(0.0), DEPTH)
    assert matcher.besides == [[]]


def test_two_places_that_face_another_way_are_not_one():
    matcher = Matcher([])
    eye = tracker(matcher)
    for turn_rad in (0.0, 0.4):
        eye.remember(
            GoodLook(0, flow(-7.0), moved(-0.5), make_pose(about_down(turn_rad), [0, 0, 0]))
        )
        eye.forget(is_wrong=True)
    eye.match(FRAME, FRAME_NS, moved(0.0), DEPTH)
    assert matcher.besides == [[]]


def test_a_mistake_is_forgiven_after_half_a_minute_or_if_nobody_flew_to_it():
    matcher = Matcher([])
    eye = tracker(matcher)
    mistaken(eye, 2)
    eye.match(FRAME, 31_000_000_000, moved(0.0), DEPTH)
    for _ in range(2):
        eye.remember(GoodLook(0, flow(-7.0), moved(-0.5), moved(0.0)))
        eye.forget(is_wrong=False)
    eye.match(FRAME, FRAME_NS, moved(0.0), DEPTH)
    assert matcher.besides == [[], []]
