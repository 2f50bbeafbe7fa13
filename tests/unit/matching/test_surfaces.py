"""One surface after the other, from the matches of features."""

import cv2
import numpy as np
import pytest
from textured_wall import turned
from two_planes import TwoPlanes

from dfvs_core.matching.features import Matches, detect_features
from dfvs_core.matching.surfaces import surface_flows, surfaces

SIZE = (240, 320)
FIRST, SECOND = turned(roll_deg=25.0, zoom=1.4, shift=(30.0, 0.0)), turned(shift=(-60.0, 25.0))


def matches_of(rng, *parts):
    """So many matches by each homography, with noise; by chance where there is none."""
    current, other = [], []
    for count, H in parts:
        at = rng.uniform((0, 0), (320, 240), (count, 2))
        to = rng.uniform((0, 0), (320, 240), (count, 2))
        if H is not None:
            to = cv2.perspectiveTransform(at[:, None], H)[:, 0] + rng.normal(0, 0.5, (count, 2))
        current.append(at)
        other.append(to)
    return Matches(np.concatenate(current).astype(np.float32), np.vstack(other).astype(np.float32))


def miss(matches, H):
    expected = cv2.perspectiveTransform(matches.current[:, None].astype(np.float64), H)[:, 0]
    return np.linalg.norm(expected - matches.other, axis=1)


@pytest.mark.parametrize("seed", range(5))
def test_the_largest_surface_comes_first_and_chance_matches_are_on_none(seed):
    matches = matches_of(np.random.default_rng(seed), (60, FIRST), (25, SECOND), (30, None))
    first, second, *rest = surfaces(matches)
    assert len(first) >= 58
    assert len(second) >= 23
    assert np.mean(miss(first, FIRST) < 4.0) > 0.93
    assert np.mean(miss(second, SECOND) < 4.0) > 0.85
    assert all(len(surface) < 12 for surface in rest)


def test_few_matches_are_no_surface():
    rng = np.random.default_rng(0)
    assert list(surfaces(matches_of(rng, (5, FIRST)))) == []


def test_matches_on_a_line_do_no_harm():
    """They make no homography: OpenCV finds none, or says so by an exception."""
    at = np.stack([np.linspace(10, 300, 40), np.linspace(20, 200, 40)], axis=1).astype(np.float32)
    for to in (at + np.float32([5, 5]), np.repeat(at[:1], 40, axis=0)):
        list(surfaces(Matches(at, to)))


def test_a_board_before_a_wall_gives_a_flow_that_is_right_on_either():
    scene = TwoPlanes()
    features = [detect_features(cv2.cvtColor(p, cv2.COLOR_RGB2GRAY)) for p in scene.pictures]
    flows = list(surface_flows(*features, SIZE))
    for part in (scene.board, ~scene.board):
        errors = [np.median(np.linalg.norm(flow - scene.flow, axis=-1)[part]) for flow in flows]
        assert min(errors) < 1.0
    assert len(flows) >= 3  # and that of all matches


def test_pictures_of_different_places_lead_nowhere_or_to_little():
    scene, elsewhere = TwoPlanes(), np.random.default_rng(0).integers(0, 255, (*SIZE, 3), np.uint8)
    pictures = scene.pictures[0], elsewhere
    features = [detect_features(cv2.cvtColor(p, cv2.COLOR_RGB2GRAY)) for p in pictures]
    assert len(list(surface_flows(*features, SIZE))) <= 2
