"""Depth from motion is kept in the goal view, cell by cell, whatever the camera does."""

import numpy as np
import pytest
from box_room import BoxRoom

from dfvs_core.depth.motion import MotionDepth
from dfvs_core.depth.source import EarlierView, GoalLink
from dfvs_core.geometry.camera import CameraModel
from dfvs_core.geometry.poses import (
    R_BODY_FORWARD_CAMERA,
    invert_pose,
    make_pose,
    rotation_from_euler,
)

CAMERA = CameraModel.from_horizontal_fov(160, 120, np.radians(75))
ROOM = BoxRoom(CAMERA)
STRIDE = 8
NOISE_PX = 0.5
PIXELS = CAMERA.grid(STRIDE)
XY = CAMERA.normalise(PIXELS)
SHAPE = XY.shape[:2]
SOURCE = MotionDepth(pixel_noise=NOISE_PX / CAMERA.fx)


def pose(position, euler_deg=(0.0, 0.0, 0.0)):
    R = rotation_from_euler(*np.radians(euler_deg)) @ R_BODY_FORWARD_CAMERA
    return make_pose(R, np.array(position, np.float64))


GOAL = pose((0.0, 0.0, 0.0))


def on_grid(values):
    return values[STRIDE // 2 :: STRIDE, STRIDE // 2 :: STRIDE]


def link_of(T_world_camera):
    """Exact link between the camera's grid and the goal view."""
    flow = ROOM.flow(T_world_camera, GOAL)
    partners = PIXELS + on_grid(flow.flow)
    index = np.floor(partners / STRIDE).astype(np.intp)
    cell = np.where(on_grid(flow.confidence) > 0, index[..., 1] * SHAPE[1] + index[..., 0], -1)
    T_current_goal = invert_pose(T_world_camera) @ GOAL
    return GoalLink(cell, CAMERA.normalise(partners), T_current_goal, SHAPE)


def earlier_of(T_world_camera, T_world_earlier, rng):
    """Correspondences with an earlier frame, of half a pixel."""
    flow = ROOM.flow(T_world_camera, T_world_earlier)
    noise = rng.normal(0.0, NOISE_PX, (*SHAPE, 2))
    xy = CAMERA.normalise(PIXELS + on_grid(flow.flow) + noise)
    T = invert_pose(T_world_earlier) @ T_world_camera
    return EarlierView(xy, on_grid(flow.confidence).astype(np.float64), T)


def observed(frames, rng):
    """Ratio (n,) of estimated and true inverse depth of the known cells, after some frames."""
    state, true_m = None, on_grid(ROOM.depth(GOAL))
    for k in range(frames):
        way = 0.5 * np.sin(np.array([0.05, 0.08, 0.03]) * k)
        turn = 6.0 * np.sin(np.array([0.02, 0.05, 0.03]) * k)
        current = pose(way, turn)
        earlier = pose(way + np.array([0.0, 0.15, 0.05]), turn)
        state = SOURCE.observe(XY, earlier_of(current, earlier, rng), link_of(current), state)
    ratio = state.rho * true_m
    known = state.variance < (0.2 * state.rho) ** 2
    return ratio[known], state


def test_many_frames_from_everywhere_add_up_without_drift(rng):
    few, _ = observed(10, rng)
    many, _ = observed(300, rng)
    assert len(many) == np.prod(SHAPE)
    # A cell is 8 px wide and its points lie anywhere in it: on a slanted wall that is a per cent.
    assert np.median(many) == pytest.approx(1.0, abs=0.01)
    assert np.percentile(np.abs(many - 1.0), 90) < 0.05
    assert np.median(np.abs(many - 1.0)) < 0.5 * np.median(np.abs(few - 1.0))


def test_the_current_view_is_given_the_depth_that_it_has_from_there(rng):
    _, state = observed(100, rng)
    for position, turn in [((0.8, 0.2, 0.1), (3, -4, 10)), ((-0.7, -0.4, 0.2), (0, 5, -15))]:
        current = pose(position, turn)
        depth = SOURCE.estimate(XY.shape[:2], link_of(current), state)
        sure = depth.validity > 0.9
        assert sure.mean() > 0.3
        ratio = depth.z_m[sure] / on_grid(ROOM.depth(current))[sure]
        assert np.median(ratio) > 0.98
        assert np.median(ratio) < 1.02
        assert np.percentile(np.abs(ratio - 1.0), 90) < 0.1


def test_the_uncertainty_is_that_of_the_goal_view():
    """Of a wall 2 m away: seen by the goal from 4 m, its inverse depth is known 4 times as well."""
    source = MotionDepth(pixel_noise=NOISE_PX / CAMERA.fx, least_spread=0.0)
    T_earlier_current = make_pose(np.eye(3), np.array([0.2, 0.0, 0.0]))
    xy = XY + np.array([0.2 / 2.0, 0.0])
    earlier = EarlierView(xy, np.ones(SHAPE), T_earlier_current)
    cells = np.arange(XY.shape[0] * XY.shape[1]).reshape(SHAPE)
    spreads = []
    for behind_m in (0.0, 2.0):
        T_current_goal = make_pose(np.eye(3), np.array([0.0, 0.0, -behind_m]))
        link = GoalLink(cells, XY * 2.0 / (2.0 + behind_m), T_current_goal, SHAPE)
        state = source.observe(XY, earlier, link, None)
        np.testing.assert_allclose(1.0 / state.rho, 2.0 + behind_m, rtol=1e-3)
        spreads.append(np.sqrt(state.variance))
    np.testing.assert_allclose(spreads[0] / spreads[1], 4.0, rtol=1e-2)
