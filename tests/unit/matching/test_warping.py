"""Backward warping, composition, and the in-bounds mask of flows."""

import numpy as np
import pytest
from textured_wall import exact_flow, inside, turned

from dfvs_core.matching.correspondence import FlowField
from dfvs_core.matching.warping import (
    backward_warp,
    compose,
    flow_at_size,
    lands_inside,
    pixel_grid,
    resized,
    sample,
)

SIZE = (240, 320)


@pytest.fixture(scope="module")
def speckle():
    """Noise from pixel to pixel: it averages out where many pixels fall on one."""
    return np.random.default_rng(0).integers(0, 255, SIZE, np.uint8)


@pytest.mark.parametrize("zoom", [3.0, 5.0])
def test_what_becomes_smaller_is_smoothed(speckle, zoom):
    flow = exact_flow(turned(zoom=zoom)).astype(np.float32)
    seen = np.s_[110:130, 145:175]
    aliased = sample(speckle, pixel_grid(SIZE) + flow)[seen].std()
    assert backward_warp(speckle, flow)[seen].std() < 0.7 * aliased


@pytest.mark.parametrize("zoom", [0.5, 1.0])
def test_what_keeps_its_size_or_grows_is_not(speckle, zoom):
    flow = exact_flow(turned(zoom=zoom, roll_deg=30.0)).astype(np.float32)
    expected = sample(speckle, pixel_grid(SIZE) + flow)
    np.testing.assert_array_equal(backward_warp(speckle, flow), expected)


def test_a_flow_out_of_the_image_gives_its_border(speckle):
    flow = np.full((*SIZE, 2), 1e4, np.float32)
    assert np.all(backward_warp(speckle, flow) == speckle[-1, -1])


def test_a_flow_of_whole_pixels_copies_them(speckle):
    flow = np.full((*SIZE, 2), (7.0, -3.0), np.float32)
    warped = backward_warp(speckle, flow)
    np.testing.assert_array_equal(warped[3:, :-7], speckle[:-3, 7:])


def test_two_flows_one_after_the_other_are_the_product_of_their_homographies():
    first, second = turned(roll_deg=8.0, shift=(9.0, -4.0)), turned(zoom=1.1, shift=(-6.0, 2.0))
    flows = (exact_flow(H).astype(np.float32) for H in (first, second))
    error = compose(*flows) - exact_flow(second @ first)
    # the second is sampled at 1/32 px, and continued beyond the border of the image
    assert np.abs(error[inside(exact_flow(first))]).max() < 0.01


def test_a_point_lands_inside_up_to_the_border_of_the_last_pixel():
    flow = np.zeros((4, 6, 2), np.float32)
    flow[0, 5] = 0.4, -0.4
    flow[1, 5] = 0.6, 0.0
    flow[2, 0] = -0.6, 0.0
    flow[3, 2] = 0.0, 0.6
    outside = np.zeros((4, 6), bool)
    outside[[1, 2, 3], [5, 0, 2]] = True
    np.testing.assert_array_equal(lands_inside(flow), ~outside)


def test_the_grid_is_shared_and_read_only():
    grid = pixel_grid((3, 4))
    np.testing.assert_array_equal(grid[2, 1], [1.0, 2.0])
    with pytest.raises(ValueError, match="read-only"):
        grid[0, 0] = 5.0


def test_an_image_of_the_size_asked_for_is_not_copied(speckle):
    assert resized(speckle, SIZE) is speckle
    half = resized(speckle, (120, 160))
    mean = speckle.reshape(120, 2, 160, 2).mean(axis=(1, 3))
    np.testing.assert_allclose(half, mean, atol=0.5)


def test_a_flow_at_another_size_leads_to_the_same_places():
    low, high = (
        np.stack([grid[..., 0], -2.0 * grid[..., 1]], axis=-1)
        for grid in (0.1 * (pixel_grid((60, 80)) + 0.5), 0.1 * (pixel_grid((120, 320)) + 0.5))
    )
    confidence = np.full((60, 80), 0.25, np.float32)
    field = FlowField(low.astype(np.float32), confidence)
    found = flow_at_size(field, (120, 320))
    inner = np.s_[1:-1, 2:-2]  # half a pixel at the border of the small one is continued
    np.testing.assert_allclose(found.flow[inner], high[inner], atol=1e-4)
    np.testing.assert_allclose(found.confidence, 0.25)
    assert flow_at_size(field, (60, 80)) is field
