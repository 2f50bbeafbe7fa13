"""What speaks for a match as a whole."""

import cv2
import numpy as np
import pytest
from textured_wall import Wall, texture
from two_planes import TwoPlanes

from dfvs_core.correspondence import FlowField
from dfvs_core.matching.merit import (
    CLEAR_MERIT,
    agreement,
    assessed,
    best_of,
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
