"""Backward warping and composition of flow fields.

Flow is a displacement, so it is the same in OpenCV's coordinates (first pixel's centre at 0, 0)
as in ours (at 0.5, 0.5).
"""

import functools
import math
from typing import TypeVar, cast

import cv2
import numpy as np

from dfvs_core.geometry.arrays import BoolArray, Float32Array, ImageArray
from dfvs_core.matching.config import PATCH_PX
from dfvs_core.matching.correspondence import FlowField

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


def backward_warp(values: Values, flow: Float32Array) -> Values:
    """Values (H, W[, C]) of the other image, warped backwards by the flow (H, W, 2).

    What shrinks much is smoothed first, against aliasing.
    """
    sigma_px = 0.5 * math.sqrt(min(max(1.0, _shrinkage(flow)), PATCH_PX) ** 2 - 1.0)
    if sigma_px > 0.0:
        values = cast(Values, cv2.GaussianBlur(values, (0, 0), sigma_px))
    return sample(values, pixel_grid(flow.shape[:2]) + flow)


def _shrinkage(flow: Float32Array) -> float:
    """How many times smaller the other image is where the flow leads into it, in the median."""
    corners = (pixel_grid(flow.shape[:2]) + flow)[::PATCH_PX, ::PATCH_PX]
    right, down = np.diff(corners, axis=1)[:-1], np.diff(corners, axis=0)[:, :-1]
    area = right[..., 0] * down[..., 1] - right[..., 1] * down[..., 0]
    return math.sqrt(float(np.median(np.abs(area)))) / PATCH_PX


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


def resized(image: ImageArray, size: tuple[int, int]) -> ImageArray:
    """Image (H, W[, C]) at ``size`` (height, width); the same object where it has that already."""
    if image.shape[:2] == size:
        return image
    return cast(ImageArray, cv2.resize(image, size[::-1], interpolation=cv2.INTER_AREA))


def flow_at_size(field: FlowField, size: tuple[int, int]) -> FlowField:
    """Flow of the same images at ``size`` (height, width)."""
    height, width = field.confidence.shape
    if (height, width) == size:
        return field
    flow, confidence = (
        cv2.resize(values, size[::-1], interpolation=cv2.INTER_LINEAR)
        for values in (field.flow, field.confidence)
    )
    scale = np.array([size[1] / width, size[0] / height], np.float32)
    return FlowField(np.asarray(flow * scale, np.float32), np.asarray(confidence, np.float32))
