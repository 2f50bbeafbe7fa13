"""The witnesses of a flow's confidence, one by one."""

import numpy as np
import pytest
from textured_wall import HEIGHT, WIDTH, texture

from dfvs_core.matching.trust import looks_alike, returns, stays_inside
from dfvs_core.matching.warping import compose, pixel_grid, sample


def constant(u, v):
    return np.full((HEIGHT, WIDTH, 2), (u, v), np.float32)


@pytest.mark.parametrize(("miss", "trust"), [(0.0, 1.0), (0.5, 0.8), (1.0, 0.5), (3.0, 0.1)])
def test_trust_falls_with_the_distance_from_where_the_flow_began(miss, trust):
    there, back = constant(8.0, -3.0), constant(-8.0 + miss, 3.0)
    np.testing.assert_allclose(returns(there, back), trust, atol=1e-4)


def test_a_picture_is_like_itself_and_like_a_brighter_print_of_it(rng):
    picture = texture(rng, HEIGHT, WIDTH)[..., 0].astype(np.uint8)
    brighter = (0.7 * picture.astype(np.float32) + 60).astype(np.uint8)
    assert looks_alike(picture, picture).min() > 0.9
    assert np.median(looks_alike(picture, brighter)) > 0.99


def test_different_textures_are_not_alike(rng):
    a, b = (texture(rng, HEIGHT, WIDTH)[..., 0].astype(np.uint8) for _ in range(2))
    assert looks_alike(a, b).mean() < 0.35


def test_plain_areas_are_not_alike_however_equal(rng):
    picture = texture(rng, HEIGHT, WIDTH)[..., 0].astype(np.uint8)
    picture[:, :100] = 77
    alike = looks_alike(picture, picture)
    assert alike[:, :95].max() == 0.0
    assert alike[:, 110:].min() > 0.9


def test_a_rare_flicker_of_one_grey_level_is_hardly_texture(rng):
    picture = np.where(rng.random((HEIGHT, WIDTH)) < 0.04, 101, 100).astype(np.uint8)
    assert looks_alike(picture, picture).mean() < 0.5


def test_only_flow_that_ends_in_the_picture_stays_inside():
    inside = stays_inside(constant(100.0, 0.0))
    assert inside[:, :220].all()
    assert not inside[:, 221:].any()


def test_following_two_flows_adds_what_each_says_where_it_is_read():
    zoom = 0.1 * (pixel_grid((HEIGHT, WIDTH)) - np.float32([160, 120]))
    both = compose(constant(20.0, 0.0), zoom)
    # at (100, 120): 20 px to the right, then the zoom's flow at (120, 120), -4 px
    np.testing.assert_allclose(both[120, 100], [16.0, 0.0], atol=1e-4)


def test_sampling_at_the_pixels_gives_the_picture_back(rng):
    values = rng.normal(size=(HEIGHT, WIDTH)).astype(np.float32)
    np.testing.assert_array_equal(sample(values, pixel_grid((HEIGHT, WIDTH))), values)
