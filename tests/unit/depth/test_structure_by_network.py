"""Structure of a goal view from the depth that a network gives of its image."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from dfvs_core.depth.network import NetworkDepth, goal_depth
from dfvs_core.depth.source import UNKNOWN_VARIANCE
from dfvs_core.errors import ImageError

SIZE = (48, 64)
PRIOR = 3.0


def network_depth(rho, spread=0.2, unit="1/m", scale_spread=0.1):
    rho = np.broadcast_to(np.asarray(rho, np.float32), SIZE).copy()
    return NetworkDepth(
        rho, np.full(SIZE, spread, np.float32), unit, scale_spread if unit in ("m", "1/m") else None
    )


def ramp():
    return np.linspace(0.1, 1.0, SIZE[1]) * np.ones(SIZE)


def test_a_metric_structure_is_that_of_the_network_at_the_cells_centres():
    found = goal_depth(network_depth(ramp()), 8, PRIOR)
    np.testing.assert_allclose(found.structure.rho, ramp()[4::8, 4::8], rtol=1e-6)
    assert found.scale_spread == 0.1


def test_the_error_of_the_whole_scale_is_none_of_the_structure():
    found = goal_depth(network_depth(ramp(), spread=0.5, scale_spread=0.3), 8, PRIOR)
    np.testing.assert_allclose(np.sqrt(found.structure.variance) / found.structure.rho, 0.4)


@given(factor=st.floats(1e-3, 1e3), stride=st.integers(2, 16))
def test_a_relative_structure_is_the_same_whatever_the_factor(factor, stride):
    one, other = (
        goal_depth(network_depth(f * ramp(), unit="relative"), stride, PRIOR) for f in (1.0, factor)
    )
    np.testing.assert_allclose(one.structure.rho, other.structure.rho, rtol=1e-4)
    assert np.median(1.0 / one.structure.rho) == pytest.approx(PRIOR, rel=0.05)
    assert one.scale_spread > 0.5


@given(factor=st.floats(1e-2, 1e2), offset=st.floats(-10.0, 10.0))
def test_an_affine_structure_is_the_same_whatever_the_offset(factor, offset):
    one, other = (
        goal_depth(network_depth(f * ramp() + o, unit="affine"), 8, PRIOR)
        for f, o in ((1.0, 0.0), (factor, factor * offset))
    )
    np.testing.assert_allclose(one.structure.rho, other.structure.rho, rtol=1e-3)
    assert (one.structure.rho > 0).all()
    assert (np.sqrt(one.structure.variance) >= 0.49 * one.structure.rho).all()


@given(height=st.integers(17, 60), width=st.integers(17, 60), stride=st.integers(2, 16))
def test_every_cell_of_the_grid_has_a_depth(height, width, stride):
    made = NetworkDepth(
        np.ones((height, width), np.float32), np.ones((height, width), np.float32), "1/m", 0.1
    )
    found = goal_depth(made, stride, PRIOR)
    assert found.structure.rho.shape == (-(-height // stride), -(-width // stride))


@pytest.mark.parametrize("nothing", [0.0, -1.0, np.nan, np.inf])
def test_what_the_network_does_not_know_is_unknown(nothing):
    rho = ramp()
    rho[:, :16] = nothing
    found = goal_depth(network_depth(rho), 8, PRIOR).structure
    np.testing.assert_allclose(found.variance[:, :2], UNKNOWN_VARIANCE)
    np.testing.assert_allclose(found.rho[:, :2], 1.0 / PRIOR)
    assert (found.variance[:, 2:] < 1.0).all()


def test_fields_of_different_sizes_are_refused():
    with pytest.raises(ImageError, match="two arrays"):
        NetworkDepth(np.ones((4, 5), np.float32), np.ones((4, 4), np.float32), "1/m", 0.1)
