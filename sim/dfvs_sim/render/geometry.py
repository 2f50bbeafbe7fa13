"""From triangles to the nearest one in each pixel: homogeneous rasterisation (numba).

A vertex is kept as (X, Y, W) = K (R p + t), so that its pixel is (X / W, Y / W). For a triangle
with rows v0, v1, v2 the edge functions are e0 = v1 x v2, e1 = v2 x v0, e2 = v0 x v1. At the pixel
p = (x, y, 1) the value e_i . p / det is the barycentric coordinate over depth, b_i / W. All three
are positive inside the visible part, behind the camera none is, and no clipping is needed
(Olano and Greer, "Triangle scan conversion using 2D homogeneous coordinates", 1997). Their sum is
1 / W, affine in the pixel, which is what the z-buffer holds.
"""

import math

import numpy as np
from numba import njit

from dfvs_core.geometry.arrays import BoolArray, Float32Array, FloatArray
from dfvs_sim.scene.mesh import Int32Array


@njit(cache=True, nogil=True, error_model="numpy")
def transform_vertices(vertices: Float32Array, P: FloatArray, out: FloatArray) -> None:
    """Write (X, Y, W) of each vertex to ``out`` (N, 3); P : (3, 4) = K [R t], px."""
    for i in range(vertices.shape[0]):
        x, y, z = float(vertices[i, 0]), float(vertices[i, 1]), float(vertices[i, 2])
        for r in range(3):
            out[i, r] = P[r, 0] * x + P[r, 1] * y + P[r, 2] * z + P[r, 3]


@njit(cache=True, nogil=True, error_model="numpy")
def cull_clusters(
    low: FloatArray, high: FloatArray, planes: FloatArray, visible: BoolArray
) -> None:
    """Mark the boxes (C, 3), (C, 3) that reach into all half-spaces n . p + d >= 0 (Q, 4)."""
    for c in range(low.shape[0]):
        inside = True
        for q in range(planes.shape[0]):
            reach = planes[q, 3]
            for k in range(3):
                n = planes[q, k]
                reach += n * (high[c, k] if n > 0.0 else low[c, k])
            if reach < 0.0:
                inside = False
                break
        visible[c] = inside


@njit(cache=True, nogil=True, error_model="numpy")
def edge_functions(clip: FloatArray, i0: int, i1: int, i2: int, e: FloatArray) -> float:
    """Write the edge functions, positive inside, to ``e`` (3, 3).

    Returns |det|, by which e . p is to be divided to give b / W, or 0 for a degenerate triangle.
    An edge shared by two triangles gets exactly opposite values, so no pixel falls between them.
    """
    x0, y0, w0 = clip[i0, 0], clip[i0, 1], clip[i0, 2]
    x1, y1, w1 = clip[i1, 0], clip[i1, 1], clip[i1, 2]
    x2, y2, w2 = clip[i2, 0], clip[i2, 1], clip[i2, 2]
    e[0, 0], e[0, 1], e[0, 2] = y1 * w2 - w1 * y2, w1 * x2 - x1 * w2, x1 * y2 - y1 * x2
    e[1, 0], e[1, 1], e[1, 2] = y2 * w0 - w2 * y0, w2 * x0 - x2 * w0, x2 * y0 - y2 * x0
    e[2, 0], e[2, 1], e[2, 2] = y0 * w1 - w0 * y1, w0 * x1 - x0 * w1, x0 * y1 - y0 * x1
    det = x0 * e[0, 0] + y0 * e[0, 1] + w0 * e[0, 2]
    scale = abs(x0 * e[0, 0]) + abs(y0 * e[0, 1]) + abs(w0 * e[0, 2])
    if not abs(det) > 1e-14 * scale:
        return 0.0
    if det < 0.0:
        for i in range(3):
            for k in range(3):
                e[i, k] = -e[i, k]
    return float(abs(det))


@njit(cache=True, nogil=True, error_model="numpy")
def pixel_range(low: float, high: float, size: int) -> tuple[int, int]:
    """First and last pixel whose centre lies in [low, high], cut to 0 .. size - 1.

    Empty (first > last) when there is none. The cut comes before the conversion: a float beyond
    the integers has no defined value as one.
    """
    if not (low <= size and high >= 0.0):
        return 1, 0
    return math.ceil(max(low, 0.5) - 0.5), math.floor(min(high, size - 0.5) - 0.5)


@njit(cache=True, nogil=True, error_model="numpy")
def screen_box(
    clip: FloatArray, triangle: Int32Array, near_m: float, width: int, height: int
) -> tuple[int, int, int, int]:
    """Pixels (x0, x1, y0, y1) that a triangle may cover; empty if x0 > x1.

    A triangle that crosses the near plane may cover all.
    """
    w0, w1, w2 = clip[triangle[0], 2], clip[triangle[1], 2], clip[triangle[2], 2]
    if w0 < near_m and w1 < near_m and w2 < near_m:
        return 1, 0, 1, 0
    if w0 < near_m or w1 < near_m or w2 < near_m:
        return 0, width - 1, 0, height - 1
    a, b, c = clip[triangle[0], 0] / w0, clip[triangle[1], 0] / w1, clip[triangle[2], 0] / w2
    x0, x1 = pixel_range(min(a, b, c), max(a, b, c), width)
    if x0 > x1:
        return 1, 0, 1, 0
    a, b, c = clip[triangle[0], 1] / w0, clip[triangle[1], 1] / w1, clip[triangle[2], 1] / w2
    y0, y1 = pixel_range(min(a, b, c), max(a, b, c), height)
    if y0 > y1:
        return 1, 0, 1, 0
    return x0, x1, y0, y1


@njit(cache=True, nogil=True, error_model="numpy")
def row_span(e: FloatArray, y: float, x0: int, x1: int) -> tuple[int, int]:
    """First and last pixel of x0 .. x1 whose centre is inside all three edges in row y."""
    low, high = x0 + 0.5, x1 + 0.5
    for i in range(3):
        a = e[i, 0]
        c = e[i, 1] * y + e[i, 2]
        if a > 0.0:
            low = max(low, -c / a)
        elif a < 0.0:
            high = min(high, -c / a)
        elif c < 0.0:
            return 1, 0
    if not low <= high:
        return 1, 0
    return math.ceil(low - 0.5), math.floor(high - 0.5)


@njit(cache=True, nogil=True, error_model="numpy")
def rasterise(  # noqa: PLR0913
    clip: FloatArray,
    triangles: Int32Array,
    ranges: Int32Array,
    near_m: float,
    inverse_depth: FloatArray,
    ids: Int32Array,
) -> None:
    """Draw triangles (M, 3) into the z-buffer, of the runs (C, 2) that are to be drawn.

    Parameters
    ----------
    clip : (N, 3) float64
        Vertices as (X, Y, W), px m and m.
    near_m : float
        Nothing nearer along the optical axis is drawn.
    inverse_depth : (H, W) float64
        1 / depth in 1/m, 0 where nothing is; updated.
    ids : (H, W) int32
        Index of the nearest triangle; updated.
    """
    height, width = inverse_depth.shape
    nearest = 1.0 / near_m
    e = np.empty((3, 3))
    for r in range(ranges.shape[0]):
        for t in range(ranges[r, 0], ranges[r, 1]):
            x0, x1, y0, y1 = screen_box(clip, triangles[t], near_m, width, height)
            if x0 > x1:
                continue
            i0, i1, i2 = triangles[t, 0], triangles[t, 1], triangles[t, 2]
            det = edge_functions(clip, i0, i1, i2, e)
            if det == 0.0:
                continue
            sx = (e[0, 0] + e[1, 0] + e[2, 0]) / det
            sy = (e[0, 1] + e[1, 1] + e[2, 1]) / det
            sz = (e[0, 2] + e[1, 2] + e[2, 2]) / det
            for j in range(y0, y1 + 1):
                y = j + 0.5
                first, last = row_span(e, y, x0, x1)
                base = sy * y + sz
                for i in range(first, last + 1):
                    q = sx * (i + 0.5) + base
                    if q > inverse_depth[j, i] and q <= nearest:
                        inverse_depth[j, i] = q
                        ids[j, i] = t
