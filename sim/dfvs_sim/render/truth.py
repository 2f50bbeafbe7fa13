"""Exact correspondences between two views, from depth and poses."""

import numpy as np

from dfvs_core.geometry.arrays import BoolArray, Float32Array, FloatArray, IntArray
from dfvs_core.geometry.camera import CameraModel
from dfvs_core.geometry.poses import invert_pose

DEPTH_TOLERANCE_M = 0.005
DEPTH_TOLERANCE_RELATIVE = 0.01
_BEHIND_M = 1e-6


def back_project(camera: CameraModel, depth_m: Float32Array) -> FloatArray:
    """Points (H, W, 3) m in the optical frame seen by each pixel; (0, 0, 0) where depth is 0."""
    xy = camera.normalise(camera.grid())
    z = depth_m.astype(np.float64)[..., None]
    return np.concatenate([xy * z, z], axis=-1)


def exact_flow(
    camera: CameraModel, T_world_a: FloatArray, depth_a_m: Float32Array, T_world_b: FloatArray
) -> Float32Array:
    """Flow (H, W, 2) px from view a to view b, on a's grid.

    NaN where a sees the sky, or where the point lies behind b's image plane.
    """
    points, z_b = _points_in_b(camera, (T_world_a, T_world_b), depth_a_m)
    known = (depth_a_m > 0) & (z_b > _BEHIND_M)
    flow = np.full((*depth_a_m.shape, 2), np.nan)
    flow[known] = camera.project(points[known]) - camera.grid()[known]
    return flow.astype(np.float32)


def visibility(
    camera: CameraModel,
    poses: tuple[FloatArray, FloatArray],
    depths_m: tuple[Float32Array, Float32Array],
) -> BoolArray:
    """Tell which pixels (H, W) of view a show a point that view b sees as well.

    A point counts as seen if its depth in b agrees, to within 5 mm or 1 %, with one of the four
    pixels of b around it, or with the plane through them (1 / depth is affine on a plane): that
    forgives sampling, also of a surface seen aslant, but not another surface in front.

    Parameters
    ----------
    camera : CameraModel
        Intrinsics of both views.
    poses : tuple
        ``T_world_a`` and ``T_world_b``, (4, 4).
    depths_m : tuple
        Depth (H, W) of a and of b; 0 is sky.
    """
    depth_a, depth_b = depths_m
    points, z_b = _points_in_b(camera, poses, depth_a)
    known = (depth_a > 0) & (z_b > _BEHIND_M)
    points[..., 2] = np.where(known, z_b, 1.0)
    pixel = camera.project(points)
    u, v = pixel[..., 0], pixel[..., 1]
    inside = known & (u >= 0) & (v >= 0) & (u < camera.width) & (v < camera.height)
    u, v, z = u[inside] - 0.5, v[inside] - 0.5, points[inside, 2]
    tolerance = np.maximum(DEPTH_TOLERANCE_M, DEPTH_TOLERANCE_RELATIVE * z)
    agrees = np.zeros(len(z), np.bool_)
    inverse = np.zeros(len(z))
    columns, rows = _neighbours(u, camera.width), _neighbours(v, camera.height)
    for j, weight_v in rows:
        for i, weight_u in columns:
            there = depth_b.take(j * camera.width + i)
            agrees |= np.abs(there - z) <= tolerance
            inverse += weight_u * weight_v / np.where(there > 0, there, np.inf)
    agrees |= np.abs(1.0 - z * inverse) * z <= tolerance
    seen = np.zeros(depth_a.shape, np.bool_)
    seen[inside] = agrees
    return seen


def _neighbours(x: FloatArray, size: int) -> list[tuple[IntArray, FloatArray]]:
    """Index and weight of the pixels before and behind a place, whose centres are whole numbers."""
    before = np.floor(x)
    behind = x - before
    index = before.astype(np.intp)
    return [
        (np.clip(index, 0, size - 1), 1.0 - behind),
        (np.clip(index + 1, 0, size - 1), behind),
    ]


def _points_in_b(
    camera: CameraModel, poses: tuple[FloatArray, FloatArray], depth_a_m: Float32Array
) -> tuple[FloatArray, FloatArray]:
    """Points (H, W, 3) m that a sees, in b's optical frame, and their depth (H, W)."""
    T_b_a = invert_pose(poses[1]) @ poses[0]
    points = back_project(camera, depth_a_m) @ T_b_a[:3, :3].T + T_b_a[:3, 3]
    return points, points[..., 2]
