"""Pictures brought by a flow."""

import numpy as np
import pytest
from textured_wall import exact_flow, turned

from dfvs_core.correspondence import FlowField
from dfvs_core.matching.warping import bring, landing_places, pixel_grid, sample

SIZE = (240, 320)


@pytest.fixture(scope="module")
def speckle():
    """Noise from pixel to pixel: it averages out where many pixels fall on one."""
    return np.random.default_rng(0).integers(0, 255, SIZE, np.uint8)


@pytest.mark.parametrize("zoom", [3.0, 5.0])
def test_what_becomes_smaller_is_smoothed(speckle, zoom):
    flow = exact_flow(turned(zoom=zoom)).astype(np.float32)
    seen = np.s_[110:130, 145:175]
    by_chance = sample(speckle, pixel_grid(SIZE) + flow)[seen].std()
    assert bring(speckle, flow)[seen].std() < 0.7 * by_chance


@pytest.mark.parametrize("zoom", [0.5, 1.0, 1.2])
def test_what_keeps_its_size_or_grows_is_not(speckle, zoom):
    flow = exact_flow(turned(zoom=zoom, roll_deg=30.0)).astype(np.float32)
    np.testing.assert_array_equal(bring(speckle, flow), sample(speckle, pixel_grid(SIZE) + flow))


def test_a_flow_that_leads_nowhere_is_brought_like_any_other(speckle):
    flow = np.full((*SIZE, 2), 1e4, np.float32)
    assert bring(speckle, flow).std() == 0.0


def test_landing_places_are_those_of_what_is_sure():
    flow = np.full((*SIZE, 2), (10.0, -5.0), np.float32)
    confidence = np.zeros(SIZE, np.float32)
    confidence[50:60, 300:320] = 1.0
    places = landing_places(FlowField(flow, confidence), 0.5)
    expected = np.zeros(SIZE, np.uint8)
    expected[45:55, 310:320] = 1
    np.testing.assert_array_equal(places, expected)
