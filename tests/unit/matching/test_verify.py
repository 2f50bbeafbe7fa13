"""Verification of match hypotheses by two-view geometry and by explained texture."""

import cv2
import numpy as np
import pytest
from textured_wall import HEIGHT, WIDTH, Wall, inside, texture
from two_planes import TwoPlanes

from dfvs_core.matching.config import MatchingConfig
from dfvs_core.matching.correspondence import FlowField
from dfvs_core.matching.points import PointMatches
from dfvs_core.matching.verify import explained_ratio, fit_two_views

CONFIG = MatchingConfig()
SCENE = TwoPlanes()
STANDSTILL = np.zeros((HEIGHT, WIDTH, 2), np.float32)


def points(rng, count):
    """Points (N, 2) anywhere in the image, at whole pixels."""
    return rng.integers((0, 0), (WIDTH, HEIGHT), (count, 2)).astype(np.float32)


def matches(current, other):
    return PointMatches(current, other.astype(np.float32), np.ones(len(current), np.float32))


def rigid(rng, count, flow=SCENE.flow):
    """Matches of a flow that stay in view, with 0.3 px of noise."""
    at = points(rng, count)
    u, v = at.astype(int).T
    at, moved = at[inside(flow)[v, u]], flow[v, u][inside(flow)[v, u]]
    return matches(at, at + moved + rng.normal(0.0, 0.3, at.shape))


def test_all_matches_of_a_rigid_scene_are_inliers(rng):
    given = rigid(rng, 300)
    found = fit_two_views(given, CONFIG)
    assert len(found) > 0.95 * len(given)


def test_gross_errors_among_the_matches_of_a_rigid_scene_are_no_inliers(rng):
    right = rigid(rng, 400)
    is_wrong = rng.random(len(right)) < 0.3
    other = np.where(is_wrong[:, None], points(rng, len(right)), right.other)
    found = fit_two_views(matches(right.current, other), CONFIG)
    kept = np.isin(other[:, 0], found.other[:, 0])
    assert kept[~is_wrong].mean() > 0.9
    assert kept[is_wrong].mean() < 0.1  # one in some dozens lies on its epipolar line by chance


def test_too_few_matches_have_no_geometry(rng):
    enough = rigid(rng, 300)
    for count in (0, 1, 7, CONFIG.least_matches - 1):
        assert fit_two_views(enough.select(np.arange(len(enough)) < count), CONFIG) is None


def test_the_same_matches_give_the_same_inliers(rng):
    noisy = rigid(rng, 300)
    first = fit_two_views(noisy, CONFIG)
    cv2.setRNGSeed(12345)
    second = fit_two_views(noisy, CONFIG)
    assert first.current.tobytes() == second.current.tobytes()


@pytest.fixture(scope="module")
def grey():
    """Textured left of the middle, plain right of it."""
    image = cv2.cvtColor(Wall(texture(np.random.default_rng(7))).picture(), cv2.COLOR_RGB2GRAY)
    image[:, WIDTH // 2 :] = 128
    return image


def test_only_texture_has_to_be_explained(grey):
    confidence = np.zeros((HEIGHT, WIDTH), np.float32)
    assert explained_ratio(grey, STANDSTILL, FlowField(STANDSTILL, confidence), CONFIG) == 0.0
    confidence[: HEIGHT // 2, : WIDTH // 2 + 8] = 1.0
    half = explained_ratio(grey, STANDSTILL, FlowField(STANDSTILL, confidence), CONFIG)
    assert half == pytest.approx(0.5, abs=0.1)  # texture is not spread evenly
    confidence[:, : WIDTH // 2 + 8] = 1.0
    assert explained_ratio(grey, STANDSTILL, FlowField(STANDSTILL, confidence), CONFIG) == 1.0


def test_only_what_stays_in_view_has_to_be_explained(grey):
    flow = np.full((HEIGHT, WIDTH, 2), (-WIDTH / 4, 0.0), np.float32)
    confidence = np.zeros((HEIGHT, WIDTH), np.float32)
    confidence[:, WIDTH // 4 : WIDTH // 2 + 8] = 1.0
    assert explained_ratio(grey, flow, FlowField(flow, confidence), CONFIG) == 1.0


def test_nothing_is_explained_where_nothing_stays_in_view(grey):
    flow = np.full((HEIGHT, WIDTH, 2), (2.0 * WIDTH, 0.0), np.float32)
    sure = np.ones((HEIGHT, WIDTH), np.float32)
    assert explained_ratio(grey, flow, FlowField(flow, sure), CONFIG) == 0.0
