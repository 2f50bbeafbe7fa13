"""A search along lines finds the surface that the first match left out."""

import numpy as np
import pytest
from test_hybrid_matcher import Oracle, match
from textured_wall import Wall, exact_flow, inside, texture, turned
from two_planes import TwoPlanes

from dfvs_core.correspondence import FlowField
from dfvs_core.matching.classical import ClassicalMatcher, carry_on, refit
from dfvs_core.matching.hybrid import HybridMatcher
from dfvs_core.matching.plane_sweep import plane_sweep
from dfvs_core.matching.semi_global import smooth_costs


@pytest.fixture(scope="module")
def scene():
    return TwoPlanes()


def share_within(flow, scene, where, px=3.0):
    return np.mean(np.linalg.norm(flow - scene.flow, axis=-1)[where] < px)


def inner(mask):
    """Without the border that one picture's board hides in the other."""
    out = np.zeros_like(mask)
    out[12:-12, 12:-12] = mask[24:, 24:] & mask[:-24, :-24] & mask[24:, :-24] & mask[:-24, 24:]
    return out


def test_the_board_in_front_is_found(scene):
    known = scene.known_edge()
    board = inner(scene.board)
    assert share_within(known.flow, scene, board) < 0.1
    swept = plane_sweep(*scene.pictures, known)
    assert share_within(swept.flow, scene, board) > 0.9
    assert np.median(swept.confidence[board]) > 0.6


def test_what_was_sure_stays(scene):
    known = scene.known_edge()
    swept = plane_sweep(*scene.pictures, known)
    assert share_within(swept.flow, scene, known.confidence > 0.5) > 0.97


def test_the_second_picture_may_be_darker_and_of_another_white(scene):
    first, second = scene.pictures
    second = (second * np.array([0.6, 0.7, 0.8]) + 5).astype(np.uint8)
    swept = plane_sweep(first, second, scene.known_edge())
    assert share_within(swept.flow, scene, inner(scene.board)) > 0.9


def test_another_picture_size_works_as_well(scene):
    half = [np.ascontiguousarray(p[20:216, 4:316]) for p in scene.pictures]
    known = scene.known_edge()
    cut = (slice(20, 216), slice(4, 316))
    swept = plane_sweep(*half, FlowField(known.flow[cut], known.confidence[cut]))
    assert swept.flow.shape == (196, 312, 2)
    error = np.linalg.norm(swept.flow - scene.flow[cut], axis=-1)
    assert np.mean(error[inner(scene.board)[cut]] < 3.0) > 0.9


def test_nothing_is_searched_where_nothing_agrees(scene):
    flow = np.random.default_rng(1).uniform(-50, 50, (240, 320, 2)).astype(np.float32)
    assert plane_sweep(*scene.pictures, FlowField(flow, np.ones((240, 320), np.float32))) is None


@pytest.mark.parametrize(
    "H",
    [np.eye(3), turned(roll_deg=30), turned(zoom=1.5), turned(shift=(400, 0))],
    ids=["still", "turned", "nearer", "away"],
)
def test_a_single_wall_whose_lines_nothing_tells_stays_finite(H):
    wall = Wall(texture(np.random.default_rng(1)))
    truth = exact_flow(H).astype(np.float32)
    confidence = np.ones((240, 320), np.float32)
    confidence[:, :100] = 0.0
    with np.errstate(all="raise"):
        swept = plane_sweep(wall.picture(), wall.picture(H), FlowField(truth, confidence))
    assert swept.is_finite()
    error = np.linalg.norm(swept.flow - truth, axis=-1)[inside(truth) & (confidence > 0.5)]
    assert not len(error) or np.mean(error < 3.0) > 0.95


def test_a_first_match_sees_both_surfaces(scene):
    known = scene.known_edge()
    oracle = Oracle(known.flow, -known.flow, known.confidence)
    field = match(HybridMatcher(oracle, judges=True), *scene.pictures)
    assert share_within(field.flow, scene, inner(scene.board)) > 0.8
    wrong = np.linalg.norm(field.flow - scene.flow, axis=-1) >= 3.0
    sure = field.confidence > 0.5
    assert np.sum(sure & wrong) < 0.1 * np.sum(sure)


def test_the_frame_after_it_still_does(scene):
    pictures = [ClassicalMatcher().prepare(p) for p in scene.pictures]
    guess = FlowField(scene.flow + np.float32(2.0), np.ones((240, 320), np.float32))
    board = inner(scene.board)
    both = carry_on(*pictures, guess)
    smooth = refit(*pictures, guess)
    assert share_within(both.flow, scene, board, 1.0) > 0.95
    assert np.mean(both.confidence[board] > 0.5) > np.mean(smooth.confidence[board] > 0.5)


def test_costs_are_made_smooth_up_to_an_edge():
    rng = np.random.default_rng(3)
    truth = np.where(np.arange(40) < 20, 2, 6)[None].repeat(30, axis=0)
    costs = rng.uniform(0.4, 0.7, (9, 30, 40)).astype(np.float32)
    np.put_along_axis(costs, truth[None], rng.uniform(0.3, 0.45, (1, 30, 40)), axis=0)
    grey = np.where(truth == 2, 20.0, 200.0).astype(np.float32)
    assert np.mean(costs.argmin(axis=0) == truth) < 0.9
    assert np.mean(smooth_costs(costs, grey).argmin(axis=0) == truth) > 0.98
