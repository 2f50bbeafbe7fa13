"""Smooth flow through scattered matches whose motion is known exactly."""

import numpy as np
import pytest
from textured_wall import HEIGHT, WIDTH, exact_flow, turned

from dfvs_core.matching.config import MatchingConfig
from dfvs_core.matching.correspondence import FlowField
from dfvs_core.matching.points import PointMatches
from dfvs_core.matching.smooth_flow import confident_matches, smooth_flow

CONFIG, SIZE = MatchingConfig(), (HEIGHT, WIDTH)
SIMILARITY = turned(roll_deg=20.0, zoom=1.2, shift=(5.0, 3.0))
SLANTED = turned(roll_deg=5.0, shift=(8.0, -4.0), perspective=(4e-4, 3e-4))


def grid(stride_px=16):
    """Points (N, 2) of a regular grid."""
    first = stride_px // 2
    u, v = np.meshgrid(np.arange(first, WIDTH, stride_px), np.arange(first, HEIGHT, stride_px))
    return np.stack([u.ravel(), v.ravel()], axis=1)


def matches(points, flow):
    """Matches at whole pixels (N, 2) that move by a flow."""
    at = points.astype(np.float32)
    moved = flow[points[:, 1], points[:, 0]].astype(np.float32)
    return PointMatches(at, at + moved, np.ones(len(points), np.float32))


def error(flow, truth):
    return np.linalg.norm(flow - truth, axis=-1)


def test_two_matches_give_a_similarity():
    truth = exact_flow(SIMILARITY)
    two = matches(np.array([[60, 50], [250, 200]]), truth)
    assert error(smooth_flow(two, SIZE, CONFIG), truth).max() < 0.1


def test_a_similarity_is_extended_to_where_there_are_no_matches():
    truth, points = exact_flow(SIMILARITY), grid()
    left = matches(points[points[:, 0] < WIDTH // 2], truth)
    assert error(smooth_flow(left, SIZE, CONFIG), truth).max() < 0.1


def test_a_slanted_plane_is_reproduced_between_its_matches():
    truth = exact_flow(SLANTED)
    off = error(smooth_flow(matches(grid(), truth), SIZE, CONFIG), truth)[8:-8, 8:-8]
    assert off.max() < 0.5
    assert off.mean() < 0.02


def test_two_surfaces_keep_their_own_motion():
    """The narrowest interpolation is 8 px wide, so 24 px from the edge only its own side counts."""
    truth = np.full((*SIZE, 2), (10.0, 0.0), np.float32)
    truth[:, WIDTH // 2 :] = 26.0, -4.0
    flow = smooth_flow(matches(grid(), truth), SIZE, CONFIG)
    away = np.abs(np.arange(WIDTH) - WIDTH // 2 + 0.5) > 24.0
    assert error(flow, truth)[:, away].max() < 1.0


@pytest.mark.parametrize(("wrong_ratio", "alike"), [(0.3, False), (0.4, True)])
def test_gross_errors_are_ignored(rng, wrong_ratio, alike):
    """They lead anywhere, or all of them 120 px aside, as a repeated structure's do."""
    truth, points = exact_flow(SLANTED), grid(8)
    right = matches(points, truth)
    anywhere = rng.uniform((0, 0), (WIDTH, HEIGHT), points.shape)
    wrong = right.other + 120.0 if alike else anywhere
    is_wrong = rng.random(len(points)) < wrong_ratio
    other = np.where(is_wrong[:, None], wrong, right.other).astype(np.float32)
    flow = smooth_flow(PointMatches(right.current, other, right.confidence), SIZE, CONFIG)
    assert np.mean(error(flow, truth) < 1.0) > 0.98


def test_a_match_without_confidence_does_not_count():
    truth, points = exact_flow(SIMILARITY), grid()
    right = matches(points, truth)
    other, confidence = right.other.copy(), right.confidence.copy()
    other[::2] += 9.0
    confidence[::2] = 0.0
    flow = smooth_flow(PointMatches(right.current, other, confidence), SIZE, CONFIG)
    assert error(flow, truth).max() < 0.05


def test_an_image_that_no_whole_number_of_cells_fills_is_covered():
    size = (37, 61)
    at = np.array([[5.0, 5.0], [50.0, 8.0], [20.0, 30.0]], np.float32)
    three = PointMatches(at, at + 3.0, np.ones(3, np.float32))
    flow = smooth_flow(three, size, CONFIG)
    assert flow.shape == (*size, 2)
    assert flow.dtype == np.float32
    np.testing.assert_allclose(flow, 3.0, atol=0.01)


def test_confident_matches_are_those_of_a_grid_where_there_is_confidence():
    flow = exact_flow(SIMILARITY).astype(np.float32)
    confidence = np.zeros(SIZE, np.float32)
    confidence[:, :80] = 1.0
    found = confident_matches(FlowField(flow, confidence))
    assert len(found) == 30 * 10
    assert found.current[:, 0].max() < 80.0
    expected = matches(found.current.astype(int), flow).other
    np.testing.assert_array_equal(found.other, expected)


def test_a_flow_comes_back_from_its_own_matches():
    truth = exact_flow(SLANTED).astype(np.float32)
    found = confident_matches(FlowField(truth, np.ones(SIZE, np.float32)))
    off = error(smooth_flow(found, SIZE, CONFIG), truth)
    assert off[4:-4, 4:-4].max() < 0.2  # beyond the outermost matches curvature is not known
