"""Flows as maps of the image plane: applied to pictures, chained, and made from homographies.

Flow is a displacement, so it is the same in OpenCV's coordinates (first pixel's centre at 0, 0)
as in ours (at 0.5, 0.5); homographies in here act on OpenCV's.
"""

from __future__ import annotations

import functools
import math
from typing import TypeVar, cast

import cv2
import numpy as np

from dfvs_core.arrays import BoolArray, Float32Array, FloatArray, ImageArray

Values = TypeVar("Values", ImageArray, Float32Array)


@functools.lru_cache(maxsize=8)
def pixel_grid(size: tuple[int, int]) -> Float32Array:
    """Coordinates (H, W, 2) as (u, v) of the pixels' centres, the first one at (0, 0).

    Kept for the next frame, and therefore read-only.
    """
    height, width = size
    u, v = np.arange(width, dtype=np.float32), np.arange(height, dtype=np.float32)
    grid = np.stack(np.meshgrid(u, v), axis=-1)
    grid.flags.writeable = False
    return grid


def sample(values: Values, at: Float32Array) -> Values:
    """Values (H, W[, C]) at the points ``at`` (h, w, 2), bilinear, the border continued."""
    u, v = at[..., 0], at[..., 1]
    out = cv2.remap(values, u, v, cv2.INTER_LINEAR, borderMode=cv2.BORDER_REPLICATE)
    return cast(Values, out)


def compose(first: Float32Array, second: Float32Array) -> Float32Array:
    """Flow (H, W, 2) that follows ``first``, then ``second`` from where that leads."""
    return first + sample(second, pixel_grid(first.shape[:2]) + first)


def lands_inside(flow: Float32Array) -> BoolArray:
    """(H, W): whether the flow leads to a point inside an image of the same size."""
    height, width = flow.shape[:2]
    at = pixel_grid((height, width)) + flow
    u, v = at[..., 0], at[..., 1]
    inside: BoolArray = (u >= -0.5) & (v >= -0.5) & (u <= width - 0.5) & (v <= height - 0.5)
    return inside


def homography_flow(H: FloatArray, size: tuple[int, int]) -> Float32Array:
    """Flow (H, W, 2) of the homography H (3, 3)."""
    grid = pixel_grid(size)
    moved = cv2.perspectiveTransform(grid.reshape(-1, 1, 2), H)
    return np.asarray(moved, dtype=np.float32).reshape(grid.shape) - grid


def similarity_flow(scale: float, turn_rad: float, size: tuple[int, int]) -> Float32Array:
    """Flow (H, W, 2) of a turn (from u to v) and a scale about the middle of the picture."""
    height, width = size
    c, s = scale * math.cos(turn_rad), scale * math.sin(turn_rad)
    u, v = 0.5 * (width - 1), 0.5 * (height - 1)
    H = np.array([[c, -s, u - c * u + s * v], [s, c, v - s * u - c * v], [0.0, 0.0, 1.0]])
    return homography_flow(H, size)
