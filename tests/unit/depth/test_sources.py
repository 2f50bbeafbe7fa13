from dataclasses import replace

import numpy as np
import pytest

from dfvs_core.depth.flow_depth import FlowDepth
from dfvs_core.depth.motion import MotionDepth
from dfvs_core.depth.source import EarlierView, GoalLink
from dfvs_core.geometry.camera import homogeneous
from dfvs_core.geometry.poses import make_pose, so3_exp

GRID = np.stack(np.meshgrid(np.linspace(-0.7, 0.7, 12), np.linspace(-0.5, 0.5, 9)), axis=-1)


def earlier_view(z, translation, rotation=(0.0, 0.0, 0.0), noise=None, confidence=1.0):
    """Exact correspondences of a scene with depth z on the grid."""
    T = make_pose(so3_exp(np.array(rotation)), np.array(translation))
    P = homogeneous(GRID) * z[..., None]
    Q = P @ T[:3, :3].T + T[:3, 3]
    xy = Q[..., :2] / Q[..., 2:]
    if noise is not None:
        xy = xy + noise
    return EarlierView(xy, np.full(z.shape, confidence), T)


def link(z, T_current_goal=None):
    """Every point of the grid is seen in a cell of its own of the goal view."""
    T = np.eye(4) if T_current_goal is None else T_current_goal
    P = homogeneous(GRID) * z[..., None]
    Q = P @ np.linalg.inv(T)[:3, :3].T + np.linalg.inv(T)[:3, 3]
    cell = np.arange(z.size).reshape(z.shape)
    return GoalLink(cell, Q[..., :2] / Q[..., 2:], T, z.shape)


def learnt(source, view, linked, state=None):
    """Depth of the current grid after a comparison, and the memory."""
    state = source.observe(GRID, view, linked, state)
    return source.estimate(GRID.shape[:2], linked, state), state


@pytest.fixture
def scene(rng):
    return 2.0 + rng.uniform(0, 3, GRID.shape[:2])


@pytest.mark.parametrize(
    ("translation", "rotation"),
    [((0.2, 0, 0), (0, 0, 0)), ((0.1, 0.05, -0.2), (0.02, -0.1, 0.05)), ((0, 0, 0.3), (0, 0, 0))],
)
def test_two_views_and_a_baseline_give_depth_in_its_units(scene, translation, rotation):
    source = MotionDepth(pixel_noise=1e-5)
    depth, _ = learnt(source, earlier_view(scene, translation, rotation), link(scene))
    # Near the focus of expansion there is no parallax; the median stands in there.
    sure = depth.validity > 0.99
    assert sure.mean() > 0.8
    np.testing.assert_allclose(depth.z_m[sure], scene[sure], rtol=0.03)


def test_where_the_goal_view_shows_nothing_the_median_stands_in(scene):
    source, linked = MotionDepth(pixel_noise=1e-5), link(scene)
    _, state = learnt(source, earlier_view(scene, (0.2, 0, 0)), linked)
    hidden = np.zeros(scene.shape, np.bool_)
    hidden[:, :4] = True
    seen = replace(linked, cell=np.where(hidden, -1, linked.cell))
    depth = source.estimate(GRID.shape[:2], seen, state)
    median = 1.0 / np.median(1.0 / scene[~hidden])
    # The sure ones count more: those that are near.
    np.testing.assert_allclose(depth.z_m[hidden], median, rtol=0.2)
    assert depth.validity[hidden].max() < 0.1


def test_a_rotation_that_is_not_known_makes_depth_less_sure(scene):
    view = earlier_view(scene, (0.1, 0.0, 0.0))
    sure, _ = learnt(MotionDepth(), view, link(scene))
    unsure, _ = learnt(MotionDepth(), replace(view, rotation_spread_rad=0.02), link(scene))
    assert np.median(unsure.validity) < 0.5 * np.median(sure.validity)


def test_a_wrong_match_is_outvoted_by_its_epipolar_line(scene):
    view = earlier_view(scene, (0.2, 0.0, 0.0))
    xy = view.xy.copy()
    xy[4, 6] += [0.0, 0.2]  # off the line: the baseline is horizontal
    depth, _ = learnt(MotionDepth(), replace(view, xy=xy), link(scene))
    assert depth.validity[4, 6] < 0.5 * np.median(depth.validity)


def test_no_number_of_measurements_makes_depth_certain(scene):
    source, state = MotionDepth(pixel_noise=1e-9), None
    for _ in range(5):
        depth, state = learnt(source, earlier_view(scene, (2.0, 0.5, 0.0)), link(scene), state)
    spread = np.sqrt(state.variance) / state.rho
    np.testing.assert_allclose(spread, source.least_spread, rtol=1e-6)
    np.testing.assert_allclose(depth.z_m, scene, rtol=0.02)


def test_another_goal_takes_the_depth_of_the_current_view_over(scene):
    source = MotionDepth(pixel_noise=1e-5)
    depth, _ = learnt(source, earlier_view(scene, (0.2, 0, 0)), link(scene))
    aside = make_pose(np.eye(3), np.array([0.3, 0.0, 0.2]))
    linked = link(depth.z_m.astype(np.float64), aside)
    again = source.estimate(GRID.shape[:2], linked, source.adopt(GRID, depth, linked))
    sure = depth.validity > 0.99
    np.testing.assert_allclose(again.z_m[sure], depth.z_m[sure], rtol=0.01)


@pytest.mark.parametrize("prior", [0.2, 2.5, 60.0])
def test_without_any_measurement_the_prior_holds(prior):
    depth = MotionDepth(prior=prior).estimate(GRID.shape[:2], None, None)
    np.testing.assert_allclose(depth.z_m, prior, rtol=1e-5)
    assert depth.validity.max() < 0.01


def test_depths_in_another_unit_are_the_same_depths(scene):
    linked, view = link(30.0 * scene), earlier_view(30.0 * scene, (6.0, 0.0, 0.0))
    depth, _ = learnt(MotionDepth(prior=90.0, pixel_noise=1e-5), view, linked)
    sure = depth.validity > 0.99
    assert sure.mean() > 0.8
    np.testing.assert_allclose(depth.z_m[sure], 30.0 * scene[sure], rtol=0.03)


def test_a_depth_beyond_the_bounds_is_not_told_as_measured(scene):
    scene[4, 6] = 1000.0
    source = MotionDepth(pixel_noise=1e-7)
    depth, _ = learnt(source, earlier_view(scene, (0.2, 0.0, 0.0)), link(scene))
    assert depth.z_m[4, 6] < 500.0
    assert depth.validity[4, 6] < 0.5


def test_flow_depth_is_the_paper_s(scene):
    view = earlier_view(scene, (0.03, 0.0, 0.0))
    depth, _ = FlowDepth(alpha=0.03).estimate(GRID, view, None)
    # With a pure sideways step of alpha the paper's formula happens to be exact.
    np.testing.assert_allclose(depth.z_m, scene, rtol=1e-4)


def test_a_camera_led_by_flow_depth_does_not_swing(scene):
    """It steps aside, each time as far as the depth that is estimated after the step before."""
    source = FlowDepth()
    depth, state = source.estimate(GRID, None, None)
    steps_m = []
    for _ in range(8):
        steps_m.append(0.02 * float(np.median(depth.z_m)))
        view = earlier_view(scene, (steps_m[-1], 0.0, 0.0))
        depth, state = source.estimate(GRID, view, state)
    np.testing.assert_allclose(steps_m[1:], steps_m[1], rtol=0.02)


def test_flow_no_longer_than_its_noise_leaves_the_depth_as_it_was(scene):
    source = FlowDepth(noise=1e-3)
    before, state = source.estimate(GRID, earlier_view(scene, (0.03, 0, 0)), None)
    still = earlier_view(scene, (1e-4, 0.0, 0.0))
    after, _ = source.estimate(GRID, still, state)
    np.testing.assert_allclose(after.z_m, before.z_m, rtol=1e-5)


def test_flow_depth_does_not_mind_turning(scene):
    turning = earlier_view(scene, (0.03, 0.0, 0.0), (0.0, -0.1, 0.0))
    depth, _ = FlowDepth().estimate(GRID, turning, None)
    # The step is seen from a camera turned by 0.1 rad: the formula is off by tan(0.1) x at most.
    np.testing.assert_allclose(depth.z_m, scene, rtol=0.25)
    assert np.median(depth.z_m / scene) == pytest.approx(1.0, abs=0.05)
