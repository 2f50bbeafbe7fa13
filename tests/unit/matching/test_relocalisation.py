"""Relocalisation from scripted match hypotheses, between images whose flow is known."""

from dataclasses import replace

import cv2
import numpy as np
import pytest
from textured_wall import HEIGHT, WIDTH, Wall, errors, exact_flow, inside, texture, turned
from two_planes import TwoPlanes

from dfvs_core.matching import relocalise as relocalisation
from dfvs_core.matching.config import MatchingConfig
from dfvs_core.matching.correspondence import FlowField, confident_ratio
from dfvs_core.matching.points import PointMatches
from dfvs_core.matching.relocalise import relocalise
from dfvs_core.matching.staged import StagedMatcher

CONFIG = MatchingConfig()
TRUE = turned(roll_deg=20.0, zoom=1.1, shift=(20.0, -10.0))
FALSE = turned(roll_deg=-30.0, shift=(-40.0, 30.0))
TRUTH = exact_flow(TRUE)
VISIBLE = inside(TRUTH, margin=8.0)
PERIOD_PX = 80
CONFIDENT = np.ones((HEIGHT, WIDTH), np.float32)


def hypothesis(motion, count):
    """At most ``count`` matches of a homography or a flow (H, W, 2), with 0.3 px of noise."""
    flow = exact_flow(motion) if motion.shape == (3, 3) else motion
    rng = np.random.default_rng(1)
    points = rng.integers((0, 0), (WIDTH, HEIGHT), (3 * count, 2))
    points = points[inside(flow)[points[:, 1], points[:, 0]]][:count]
    moved = points + flow[points[:, 1], points[:, 0]] + rng.normal(0.0, 0.3, points.shape)
    return PointMatches(
        points.astype(np.float32), moved.astype(np.float32), np.ones(len(points), np.float32)
    )


RIGHT, WRONG = hypothesis(TRUE, 200), hypothesis(FALSE, 40)


class Scripted:
    """Point matcher that yields given hypotheses, and counts how many were asked for."""

    width_px = WIDTH

    def __init__(self, *hypotheses):
        self._hypotheses = hypotheses
        self.asked = 0

    def __iter__(self):
        for each in self._hypotheses:
            self.asked += 1
            yield each

    def encode(self, image):
        return None

    def hypotheses(self, current, other, exclusion=None):
        return iter(self)


@pytest.fixture(scope="module")
def pictures():
    wall = Wall(texture(np.random.default_rng(7)))
    return wall.picture(), wall.picture(TRUE)


@pytest.fixture(scope="module")
def repeated():
    """A picture that looks the same after a shift by a multiple of ``PERIOD_PX``."""
    part = Wall(texture(np.random.default_rng(9))).picture()[:, :PERIOD_PX]
    smooth = cv2.GaussianBlur(np.tile(part, (1, 5, 1)), (0, 0), 2.0)
    return np.ascontiguousarray(smooth[:, PERIOD_PX // 2 : PERIOD_PX // 2 + WIDTH])


def found(pictures, hypotheses, config=CONFIG):
    a, b = (cv2.cvtColor(picture, cv2.COLOR_RGB2GRAY) for picture in pictures)
    return relocalise(a, b, hypotheses, config)


def match(pictures, points, excluded=()):
    matcher = StagedMatcher(points, CONFIG)
    return matcher.match(*map(matcher.encode, pictures), excluded=excluded)


def shifted(right_px):
    return FlowField(np.full((HEIGHT, WIDTH, 2), (right_px, 0.0), np.float32), CONFIDENT)


def is_right(field):
    return np.mean(errors(field, TRUTH)[VISIBLE] < 1.0) > 0.97


def test_a_right_hypothesis_becomes_a_dense_flow(pictures):
    field = found(pictures, [RIGHT])
    assert is_right(field)
    assert np.mean(field.confidence[VISIBLE] > 0.5) > 0.9


def test_few_matches_are_enough(pictures):
    assert is_right(found(pictures, [hypothesis(TRUE, 14)]))


def test_a_flow_grows_from_a_cluster_of_matches_to_all_that_is_in_view():
    """They say little about how the plane is slanted, so that far from them it is not found."""
    H = turned(roll_deg=10.0, shift=(10.0, -5.0), perspective=(8e-4, -4e-4))
    wall, truth = Wall(texture(np.random.default_rng(7))), exact_flow(H)
    matches = hypothesis(H, 1500)
    cluster = (np.abs(matches.current - np.array([110.0, 120.0])) < 40.0).all(axis=1)
    field = found((wall.picture(), wall.picture(H)), [matches.select(cluster)])
    visible = inside(truth, margin=8.0)
    assert np.mean(errors(field, truth)[visible] < 1.0) > 0.98
    assert np.mean(field.confidence[visible] > 0.5) > 0.95


def test_what_a_search_has_confirmed_is_kept_where_the_next_one_finds_nothing(
    pictures, monkeypatch
):
    left, right = CONFIDENT.copy(), CONFIDENT.copy()
    left[:, WIDTH // 2 :] = right[:, : WIDTH // 2] = 0.0
    searches = iter([left, right, right])
    monkeypatch.setattr(
        relocalisation,
        "search_residual",
        lambda *_: FlowField(TRUTH.astype(np.float32), next(searches)),
    )
    field = found(pictures, [RIGHT])
    assert confident_ratio(field) == 1.0


def test_two_surfaces_of_a_rigid_scene_move_by_themselves():
    scene = TwoPlanes()
    field = found(scene.pictures, [hypothesis(scene.flow, 200)])
    board, wall = np.s_[70:170, 200:260], np.s_[60:180, 75:120]
    for part in (board, wall):
        assert np.median(errors(field, scene.flow)[part]) < 0.4
        assert np.mean(field.confidence[part] > 0.5) > 0.9


@pytest.mark.parametrize("count", [20, 200])
@pytest.mark.parametrize("wrong_count", [40, 100, 200])
def test_a_wrong_hypothesis_is_passed_over_for_a_right_one(pictures, count, wrong_count):
    hypotheses = hypothesis(FALSE, wrong_count), hypothesis(TRUE, count)
    assert is_right(found(pictures, hypotheses))
    assert is_right(match(pictures, Scripted(*hypotheses)))


def test_a_wrong_hypothesis_alone_gives_nothing(pictures):
    assert found(pictures, [WRONG]) is None
    assert match(pictures, Scripted(WRONG)).confidence.max() == 0.0


def test_a_match_that_leaves_little_of_the_view_is_none(pictures):
    """All of it is explained, but tracking would lose it at once."""
    picture = pictures[0]
    other = Wall(texture(np.random.default_rng(99))).picture()
    other[:48, :64] = picture[-48:, -64:]
    v, u = np.mgrid[6:42:4, 6:58:4]
    to = np.column_stack([u.ravel(), v.ravel()]).astype(np.float32)
    at = to + np.array([WIDTH - 64, HEIGHT - 48], np.float32)
    hypotheses = [PointMatches(at, to, np.ones(len(at), np.float32))]
    assert found((picture, other), hypotheses) is None
    anything = replace(CONFIG, least_confident_ratio=0.0)
    assert found((picture, other), hypotheses, anything) is not None


def test_a_match_that_explains_little_of_what_both_see_is_none(pictures):
    """Two places share a picture, say, and nothing around it."""
    picture = pictures[0]
    other = Wall(texture(np.random.default_rng(99))).picture()
    shared = np.s_[70:162, 100:192]
    other[shared] = picture[shared]
    v, u = np.mgrid[76:156:4, 106:186:4]
    at = np.column_stack([u.ravel(), v.ravel()]).astype(np.float32)
    hypotheses = [PointMatches(at, at, np.ones(len(at), np.float32))]
    assert found((picture, other), hypotheses) is None
    anything = replace(CONFIG, least_explained_ratio=0.0)
    assert found((picture, other), hypotheses, anything) is not None


@pytest.mark.parametrize("spread_px", [0.0, 1e-3, 1.0])
def test_matches_that_all_lead_to_one_point_give_nothing(pictures, spread_px):
    to = 50.0 + np.random.default_rng(3).normal(0.0, 1.0, RIGHT.other.shape) * spread_px
    assert found(pictures, [replace(RIGHT, other=to.astype(np.float32))]) is None


def test_random_matches_give_nothing(pictures):
    to = np.random.default_rng(3).uniform((0, 0), (WIDTH, HEIGHT), RIGHT.other.shape)
    assert found(pictures, [replace(RIGHT, other=to.astype(np.float32))]) is None


@pytest.mark.parametrize("hypotheses", [[], [RIGHT.select(np.arange(len(RIGHT)) < 5)]])
def test_no_matches_or_too_few_give_nothing(pictures, hypotheses):
    assert found(pictures, hypotheses) is None
    field = match(pictures, Scripted(*hypotheses))
    assert field.is_finite()
    assert field.confidence.max() == 0.0


def test_no_hypothesis_is_asked_for_after_a_likely_one(pictures):
    hypotheses = Scripted(WRONG, RIGHT, WRONG)
    assert is_right(found(pictures, hypotheses))
    assert hypotheses.asked == 2


def test_a_few_hypotheses_are_asked_for_while_none_is_likely(pictures):
    hypotheses = Scripted(WRONG, hypothesis(FALSE, 5), hypothesis(TRUE, 20))
    assert found(pictures, hypotheses) is None
    assert hypotheses.asked == MatchingConfig().most_hypotheses == 2


def test_a_rejected_hypothesis_gives_way_to_another_one(repeated):
    ahead, aside = (hypothesis(turned(shift=(x, 0.0)), 200) for x in (PERIOD_PX, 0.0))
    for excluded, expected_px in [((), PERIOD_PX), ((shifted(PERIOD_PX),), 0.0)]:
        field = match((repeated, repeated), Scripted(ahead, aside), excluded)
        confident = field.confidence > 0.5
        assert confident_ratio(field) > 0.5
        assert np.median(field.flow[confident][:, 0]) == pytest.approx(expected_px, abs=0.2)


def test_where_all_hypotheses_are_rejected_there_is_none(repeated):
    excluded = shifted(PERIOD_PX), shifted(0.0)
    hypotheses = [hypothesis(turned(shift=(x, 0.0)), 200) for x in (PERIOD_PX, 0.0)]
    assert match((repeated, repeated), Scripted(*hypotheses), excluded).confidence.max() == 0.0


def test_a_flow_that_grows_into_a_rejected_one_has_no_confidence_there(repeated):
    """The rejected flow is the true one left of the middle, where matches do not count."""
    points = Scripted(hypothesis(turned(shift=(PERIOD_PX, 0.0)), 200))
    assert confident_ratio(match((repeated, repeated), points)) > 0.5
    rejected = shifted(PERIOD_PX)
    rejected.flow[:, WIDTH // 2 :] = 9 * PERIOD_PX
    confidence = match((repeated, repeated), points, (rejected,)).confidence
    assert confidence[:, : WIDTH // 2].max() == 0.0
    assert np.mean(confidence[:, WIDTH // 2 : WIDTH - PERIOD_PX] > 0.5) > 0.9
