"""Looks from one place: which of them show the goal in the same spot of the world."""

import math

import numpy as np
import pytest

from dfvs_bench.methods.panorama import RING_RAD, Panorama, ScanMatch, ring
from dfvs_core.geometry.camera import CameraModel
from dfvs_core.matching.correspondence import FlowField

CAMERA = CameraModel.from_horizontal_fov(160, 120, math.radians(90))
SIZE = (CAMERA.height, CAMERA.width)


def look(R, score, beside_px=0.0):
    """What a camera turned by R sees of a goal picture that was taken straight ahead."""
    pixels = CAMERA.grid()
    xy = CAMERA.normalise(pixels)
    rays = np.concatenate([xy, np.ones((*SIZE, 1))], axis=-1) @ R.T
    at = CAMERA.project(rays) + np.array([beside_px, 0.0])
    inside = ((at >= 0) & (at <= np.array(CAMERA.size) - 1)).all(axis=-1)
    field = FlowField((at - pixels).astype(np.float32), inside.astype(np.float32))
    return ScanMatch(R, field, score)


def panorama(*looks, camera=CAMERA):
    made = Panorama(camera)
    for each in looks:
        made.add(each)
    return made


def test_the_ring_is_straight_ahead_and_eight_directions_about_it():
    ahead, *others = ring()
    np.testing.assert_array_equal(ahead, np.eye(3))
    axes = np.array([R[:, 2] for R in others])
    np.testing.assert_allclose(axes[:, 2], math.cos(RING_RAD))
    assert len({tuple(np.round(axis, 6)) for axis in axes}) == 8
    np.testing.assert_allclose(axes.sum(axis=0)[:2], 0.0, atol=1e-9)


def test_two_that_agree_outweigh_a_better_one():
    _, a, b, c, *_ = ring()
    right = look(a, 0.03), look(b, 0.04)
    assert panorama(*right, look(c, 0.06, beside_px=40)).best() is right[1]
    assert panorama(*right, wrong := look(c, 0.08, beside_px=40)).best() is wrong


@pytest.mark.parametrize(("width", "height"), [(320, 240), (160, 90)])
def test_matches_at_the_matcher_s_size_agree_as_those_at_the_camera_s_do(width, height):
    _, a, b, c, *_ = ring()
    right = look(a, 0.03), look(b, 0.04)
    made = panorama(*right, look(c, 0.06, beside_px=40), camera=CAMERA.scaled(width, height))
    assert made.best() is right[1]


def test_matches_that_do_not_overlap_cannot_agree():
    ahead, right, *_ = ring()
    opposite = ring()[5]
    first, second = look(right @ right, 0.03), look(opposite @ opposite, 0.04)
    third = look(ahead, 0.05)
    assert panorama(first, second, look(ahead, 0.06, beside_px=40)).best().score == 0.06
    assert panorama(first, second, third).best() is third


def test_a_wrong_place_takes_all_matches_at_it_along():
    _, a, b, c, *_ = ring()
    wrong = look(a, 0.2, beside_px=30), look(b, 0.3, beside_px=30)
    right = look(c, 0.05)
    made = panorama(*wrong, right)
    assert made.best() is wrong[1]
    made.dismiss(wrong[1], place=True)
    assert made.best() is right


def test_a_look_that_was_lost_leaves_the_others_of_its_place():
    _, a, b, *_ = ring()
    lost, other = look(a, 0.2), look(b, 0.1)
    made = panorama(lost, other)
    made.dismiss(lost, place=False)
    assert made.best() is other
    made.dismiss(other, place=False)
    assert made.best() is None


@pytest.mark.parametrize("score", [0.0, -1.0])
def test_a_look_that_shows_nothing_is_not_followed(score):
    assert panorama(look(np.eye(3), score)).best() is None
