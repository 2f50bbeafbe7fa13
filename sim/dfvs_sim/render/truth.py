"""Exact correspondences between two views, from depth and poses (numba)."""

import functools

import numpy as np
from numba import njit

from dfvs_core.geometry.arrays import BoolArray, Float32Array, FloatArray
from dfvs_core.geometry.camera import CameraModel
from dfvs_core.geometry.poses import invert_pose

DEPTH_TOLERANCE_M = 0.005
DEPTH_TOLERANCE_RELATIVE = 0.01
_BEHIND_M = 1e-6


def exact_flow(
    camera: CameraModel, T_world_a: FloatArray, depth_a_m: Float32Array, T_world_b: FloatArray
) -> Float32Array:
    """Flow (H, W, 2) px from view a to view b, on a's grid.

    NaN where a sees the sky, or where the point lies behind b's image plane.
    """
    pixels, _ = _seen_from_b(camera, (T_world_a, T_world_b), depth_a_m)
    return _flow(camera, pixels)


def visibility(
    camera: CameraModel,
    poses: tuple[FloatArray, FloatArray],
    depths_m: tuple[Float32Array, Float32Array],
) -> BoolArray:
    """Tell which pixels (H, W) of view a show a point that view b sees as well.

    A point counts as seen if its depth in b agrees, to within 5 mm or 1 %, with one of the four
    pixels of b around it, or with the plane through them (1 / depth is affine on a plane): that
    forgives sampling, also of a surface seen aslant, but not another surface in front.

    ``poses`` are ``T_world_a`` and ``T_world_b`` (4, 4), ``depths_m`` (H, W) of a and of b, where 0
    is sky; both views have these intrinsics.
    """
    pixels, z = _seen_from_b(camera, poses, depths_m[0])
    return _agrees(pixels, z, depths_m[1])


def correspondences(
    camera: CameraModel,
    poses: tuple[FloatArray, FloatArray],
    depths_m: tuple[Float32Array, Float32Array],
) -> tuple[Float32Array, BoolArray]:
    """:func:`exact_flow` and :func:`visibility` of two views, in one go."""
    pixels, z = _seen_from_b(camera, poses, depths_m[0])
    return _flow(camera, pixels), _agrees(pixels, z, depths_m[1])


def _seen_from_b(
    camera: CameraModel, poses: tuple[FloatArray, FloatArray], depth_a_m: Float32Array
) -> tuple[FloatArray, FloatArray]:
    """Pixels (H, W, 2) of b where the points that a sees are, NaN where none is, and depth m."""
    T_b_a = invert_pose(poses[1]) @ poses[0]
    xy, z = _moved(_rays(camera), depth_a_m, T_b_a)
    return camera.denormalise(xy), z


def _flow(camera: CameraModel, pixels: FloatArray) -> Float32Array:
    return (pixels - camera.grid()).astype(np.float32)


@functools.lru_cache(maxsize=8)
def _rays(camera: CameraModel) -> FloatArray:
    """Normalised coordinates (H, W, 2) of a camera's pixels."""
    return camera.normalise(camera.grid())


@njit(cache=True, nogil=True, error_model="numpy")
def _moved(xy: FloatArray, depth_m: Float32Array, T: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Normalised coordinates (H, W, 2) and depth (H, W) m of points in another frame."""
    height, width = depth_m.shape
    there, z_there = np.full((height, width, 2), np.nan), np.zeros((height, width))
    for v in range(height):
        for u in range(width):
            z = float(depth_m[v, u])
            x, y = xy[v, u, 0] * z, xy[v, u, 1] * z
            depth = T[2, 0] * x + T[2, 1] * y + T[2, 2] * z + T[2, 3]
            if z > 0.0 and depth > _BEHIND_M:
                there[v, u, 0] = (T[0, 0] * x + T[0, 1] * y + T[0, 2] * z + T[0, 3]) / depth
                there[v, u, 1] = (T[1, 0] * x + T[1, 1] * y + T[1, 2] * z + T[1, 3]) / depth
                z_there[v, u] = depth
    return there, z_there


@njit(cache=True, nogil=True, error_model="numpy")
def _agrees(pixels: FloatArray, z_m: FloatArray, depth_m: Float32Array) -> BoolArray:
    """Whether points at pixels (H, W, 2), z away, are what a view of this depth (H, W) shows."""
    height, width = depth_m.shape
    seen = np.zeros((height, width), np.bool_)
    for row in range(height):
        for column in range(width):
            u, v, z = pixels[row, column, 0], pixels[row, column, 1], z_m[row, column]
            if not (0.0 <= u < width and 0.0 <= v < height):
                continue
            tolerance = max(DEPTH_TOLERANCE_M, DEPTH_TOLERANCE_RELATIVE * z)
            left, top = int(np.floor(u - 0.5)), int(np.floor(v - 0.5))
            inverse = 0.0
            for j in range(2):
                for i in range(2):
                    x, y = min(max(left + i, 0), width - 1), min(max(top + j, 0), height - 1)
                    there = float(depth_m[y, x])
                    if abs(there - z) <= tolerance:
                        seen[row, column] = True
                    if there > 0.0:
                        weight = (1.0 - abs(u - 0.5 - left - i)) * (1.0 - abs(v - 0.5 - top - j))
                        inverse += weight / there
            if abs(1.0 - z * inverse) * z <= tolerance:
                seen[row, column] = True
    return seen
