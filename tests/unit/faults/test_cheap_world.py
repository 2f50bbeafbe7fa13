"""The wall and the network that misbehaves on purpose."""

import math

import numpy as np
import pytest

from dfvs_core.geometry.camera import CameraModel
from dfvs_core.geometry.poses import invert_pose
from dfvs_models.catalog import load_matcher
from dfvs_robustness.harness.network import Misbehaviour, write_bundle
from dfvs_robustness.harness.wall import WALL_NORTH_M, Pose, Wall, noise_texture, ramp_texture

CAMERA = CameraModel.from_horizontal_fov(160, 120, math.radians(75.0))
HERE = Pose((-0.8, 0.3, -0.1), 0.02, -0.03, 0.1)


def exact_flow(a, b):
    """Flow (H, W, 2) from pose a to pose b, by rays on the wall."""
    pixels = np.stack(np.meshgrid(np.arange(160) + 0.5, np.arange(120) + 0.5), axis=-1)
    xy = CAMERA.normalise(pixels.reshape(-1, 2))
    rays = np.column_stack([xy, np.ones(len(xy))])
    T = a.T_scene_camera()
    directions = rays @ T[:3, :3].T
    reach = (WALL_NORTH_M - T[0, 3]) / directions[:, 0]
    points = T[:3, 3] + directions * reach[:, None]
    seen = (
        points @ invert_pose(b.T_scene_camera())[:3, :3].T + invert_pose(b.T_scene_camera())[:3, 3]
    )
    return (CAMERA.project(seen) - pixels.reshape(-1, 2)).reshape(120, 160, 2)


@pytest.fixture(scope="module")
def network(tmp_path_factory):
    return load_matcher(str(write_bundle(tmp_path_factory.mktemp("bundle") / "ramp")), 1)


@pytest.fixture
def ramp(rng):
    return Wall(ramp_texture(), CAMERA, rng)


def test_the_wall_shows_what_geometry_says(rng):
    wall = Wall(noise_texture(rng), CAMERA, rng)
    flow = exact_flow(HERE, Pose())
    here, goal = wall.render(HERE).astype(float), wall.render(Pose()).astype(float)
    v, u = np.mgrid[20:100:5, 20:140:5]
    at = np.rint(np.stack([u, v], axis=-1) + flow[v, u]).astype(int)
    inside = (at[..., 0] >= 0) & (at[..., 0] < 160) & (at[..., 1] >= 0) & (at[..., 1] < 120)
    there = goal[at[..., 1][inside], at[..., 0][inside]]
    # Rounded to whole px: what is left is the texture's detail below a px.
    assert np.abs(here[v, u][inside] - there).mean() < 8.0
    assert np.abs(here[v, u] - goal[v, u]).mean() > 15.0


def test_the_network_finds_the_flow(network, ramp):
    here, goal = (network.encode(ramp.capture(pose)) for pose in (HERE, Pose()))
    field = network.match(here, goal)
    error = np.linalg.norm(field.flow - exact_flow(HERE, Pose()), axis=-1)
    sure = field.confidence > 0.5
    assert sure.mean() > 0.4
    # An affine map for what is a perspective one: good for a goal a metre away.
    assert np.median(error[sure]) < 3.0
    assert np.linalg.norm(field.flow, axis=-1).mean() > 15.0


@pytest.mark.parametrize("what", [Misbehaviour.NAN, Misbehaviour.GARBAGE, Misbehaviour.ONE_WAY])
def test_the_network_misbehaves_where_the_blue_says_so(network, ramp, what):
    picture = ramp.capture(HERE)
    picture[:, :, 2] = what.blue
    field = network.match(network.encode(picture), network.encode(ramp.capture(Pose())))
    assert field.confidence.max() < 0.3
    assert field.is_finite()


def test_two_shots_of_one_view_differ_by_noise_alone(ramp):
    a, b = ramp.capture(HERE).astype(float), ramp.capture(HERE).astype(float)
    assert not np.array_equal(a, b)
    assert np.abs(a - b).mean() < 5.0
