"""The rasteriser against rays that are tested with every triangle, one by one."""

import numpy as np
from hypothesis import given
from hypothesis import strategies as st
from tiny_scenes import random_triangles, scene_of

from dfvs_core.geometry.camera import CameraModel
from dfvs_core.geometry.poses import make_pose, rotation_from_euler
from dfvs_sim.render.renderer import NEAR_M, Renderer

CAMERA = CameraModel(40, 30, 26.0, 27.0, 19.3, 15.8)
EDGE = 1e-6
"""Barycentric coordinate within which a ray may hit or miss a triangle, by rounding."""


def rays(pose):
    """Directions (H * W, 3) in the world, of unit length along the optical axis."""
    x, y = np.moveaxis(CAMERA.normalise(CAMERA.grid()), -1, 0)
    return np.stack([x, y, np.ones_like(x)], -1).reshape(-1, 3) @ pose[:3, :3].T


def hits(origin, directions, corners):
    """Depth (R, M) of every ray on every triangle's plane and its least barycentric (R, M)."""
    a, b, c = (corners[:, k].astype(np.float64) for k in range(3))
    normal = np.cross(b - a, c - a)
    with np.errstate(divide="ignore", invalid="ignore"):
        depth = np.einsum("mk,mk->m", normal, a - origin) / (directions @ normal.T)
        points = origin + depth[..., None] * directions[:, None]
        areas = [
            np.einsum("mk,rmk->rm", normal, np.cross(q - p, points - p))
            for p, q in ((b, c), (c, a), (a, b))
        ]
        least = np.min(areas, axis=0) / np.einsum("mk,mk->m", normal, normal)
    return depth, least


@given(seed=st.integers(0, 2**31), count=st.integers(1, 30))
def test_depth_is_that_of_the_nearest_triangle_a_ray_meets(seed, count):
    rng = np.random.default_rng(seed)
    corners = random_triangles(rng, count).astype(np.float32)
    pose = make_pose(rotation_from_euler(*rng.uniform(-3, 3, 3)), rng.normal(size=3))
    got = Renderer(scene_of(corners)).depth(CAMERA, pose).reshape(-1)
    depth, least = hits(pose[:3, 3], rays(pose), corners)
    ahead = depth >= NEAR_M

    def nearest(inside):
        return np.where(ahead & inside, depth, np.inf).min(axis=1)

    sure, possible = nearest(least >= EDGE), nearest(least >= -EDGE)
    far = np.where(got > 0, got.astype(np.float64), np.inf)
    # single precision of the answer, and rounding where a plane is seen edge-on
    assert (far <= sure * (1 + 1e-5)).all()
    assert (far >= possible * (1 - 1e-5)).all()


@given(seed=st.integers(0, 2**31))
def test_moving_scene_and_camera_together_changes_nothing(seed):
    rng = np.random.default_rng(seed)
    corners = random_triangles(rng, 20)
    pose = make_pose(rotation_from_euler(*rng.uniform(-3, 3, 3)), rng.normal(size=3))
    motion = make_pose(rotation_from_euler(*rng.uniform(-3, 3, 3)), rng.normal(size=3))
    moved = corners @ motion[:3, :3].T + motion[:3, 3]
    first = Renderer(scene_of(corners)).depth(CAMERA, pose)
    second = Renderer(scene_of(moved)).depth(CAMERA, motion @ pose)
    same = np.isclose(first, second, rtol=1e-4)
    # a vertex rounded to 1e-7 m moves outlines by as much: a pixel in a thousand may change sides
    assert same.mean() > 0.99
