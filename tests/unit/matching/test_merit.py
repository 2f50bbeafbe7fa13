"""What speaks for a match as a whole."""

import cv2
import numpy as np
import pytest
from textured_wall import Wall, texture
from two_planes import TwoPlanes

from dfvs_core.correspondence import FlowField
from dfvs_core.matching.merit import (
    CLEAR_MERIT,
    Candidate,
    agreement,
    assessed,
    best_of,
    joined,
    merit_of,
)
from dfvs_core.matching.refinement import refine
from dfvs_core.matching.sureness import nothing
from dfvs_core.matching.texture import has_texture

SIZE = (240, 320)


@pytest.fixture(scope="module")
def scene():
    return TwoPlanes()


@pytest.fixture(scope="module")
def textured(scene):
    return has_texture(cv2.cvtColor(scene.pictures[0], cv2.COLOR_RGB2GRAY))


def constant(u, v):
    return np.full((*SIZE, 2), (u, v), np.float32)


def test_the_true_flow_is_clear(scene, textured):
    truth = FlowField(scene.flow, np.ones(SIZE, np.float32))
    assert merit_of(truth, textured) > 4 * CLEAR_MERIT


def test_a_small_part_is_worth_less_than_the_whole(scene, textured):
    part = np.zeros(SIZE, np.float32)
    part[60:120, 60:140] = 1.0
    assert merit_of(FlowField(scene.flow, part), textured) < CLEAR_MERIT


def test_what_no_camera_motion_explains_counts_half(scene, textured):
    rng = np.random.default_rng(1)
    chance = rng.uniform(-20, 20, (*SIZE, 2)).astype(np.float32)
    sure = np.ones(SIZE, np.float32)
    assert agreement(FlowField(chance, sure)) == 0.5
    assert agreement(FlowField(scene.flow, sure)) == 1.0


def test_nothing_has_no_merit(textured):
    assert merit_of(nothing(SIZE), textured) == 0.0


def test_a_pattern_matched_to_its_neighbour_has_less_merit_than_to_itself():
    """Tiles all alike, and a picture on the wall that tells where they are."""
    tiled = np.tile(texture(np.random.default_rng(5), 40, 40), (20, 22, 1)).astype(np.uint8)
    tiled[300:420, 300:400] = Wall(texture(np.random.default_rng(6))).picture()[:120, :100]
    a, b = tiled[200:440, 200:520], tiled[207:447, 195:515]
    greys = [cv2.cvtColor(np.ascontiguousarray(p), cv2.COLOR_RGB2GRAY) for p in (a, b)]
    itself, neighbour = (refine(*greys, constant(5.0 + k * 40.0, -7.0)) for k in (0, 1))
    assert np.mean(neighbour.confidence > 0.5) > 0.3  # it is sure of itself
    textured = has_texture(greys[0])
    assert merit_of(neighbour, textured) < 0.7 * merit_of(itself, textured)


def test_the_best_is_taken_and_nothing_asked_for_after_a_clear_one(scene, textured):
    truth = FlowField(scene.flow, np.ones(SIZE, np.float32))
    part = np.zeros(SIZE, np.float32)
    part[60:120, 60:140] = 1.0
    small = FlowField(scene.flow, part)

    def candidates():
        yield assessed(nothing(SIZE), textured)
        yield assessed(small, textured)
        yield assessed(truth, textured)
        pytest.fail("asked for more")

    best = best_of(candidates())
    assert best is not None
    assert best.field is truth
    poor = best_of(assessed(field, textured) for field in (nothing(SIZE), small, nothing(SIZE)))
    assert poor is not None
    assert poor.field is small
    assert best_of([]) is None


def test_a_plain_wall_has_no_texture_and_a_picture_on_it_does():
    grey = np.full(SIZE, 120, np.uint8)
    grey[80:160, 100:200] = np.random.default_rng(0).integers(0, 255, (80, 100), np.uint8)
    textured = has_texture(grey)
    assert textured[90:150, 110:190].all()
    assert not textured[:60].any()


def patch(columns, u, v=0.0, confidence=1.0):
    """A flow that is sure in some columns alone."""
    sure = np.zeros(SIZE, np.float32)
    sure[:, columns] = confidence
    return FlowField(constant(u, v), sure)


def test_what_agrees_with_the_best_match_adds_to_it():
    best, more = patch(slice(0, 60), 5.0), patch(slice(50, 120), 6.0, confidence=0.9)
    field = joined([Candidate(more, 0.1), Candidate(best, 0.2)])
    assert (field.confidence > 0.5).mean() == pytest.approx(120 / 320)
    assert (field.flow[:, 10, 0] == 5.0).all()
    assert (field.flow[:, 100, 0] == 6.0).all()


@pytest.mark.parametrize(
    "other",
    [
        patch(slice(50, 120), 9.0),  # another motion
        patch(slice(60, 120), 5.0),  # nothing in common
        patch(slice(59, 120), 5.0),  # too little in common
    ],
)
def test_what_does_not_agree_is_left_out(other):
    best = patch(slice(0, 60), 5.0)
    field = joined([Candidate(best, 0.2), Candidate(other, 0.1)])
    assert np.array_equal(field.confidence, best.confidence)
