"""How far a flow vector can be trusted, from what the two pictures and flows say of it.

Three witnesses, each 0 to 1 and multiplied: the point returns to where it came from; its
surroundings look alike in both pictures; it stays inside the picture. A plain wall has nothing
to look alike, so it is not trusted even where its flow happens to be right.
"""

from __future__ import annotations

from typing import cast

import cv2
import numpy as np

from dfvs_core.arrays import Float32Array, ImageArray
from dfvs_core.matching.warping import lands_inside, pixel_grid, sample

_RETURN_PX = 1.0
_ALIKE_RADIUS_PX = 4
_ALIKE_FULL = 0.8
_FAINT_GREY2 = 0.1


def returns(there: Float32Array, back: Float32Array) -> Float32Array:
    """1 where going ``there`` (H, W, 2) and ``back`` ends where it began, 0.5 a pixel away.

    The inverse square was found by counting how often vectors of each miss were right.
    """
    at = pixel_grid((there.shape[0], there.shape[1]))
    miss = there + sample(back, at + there)
    square = np.einsum("hwc,hwc->hw", miss, miss)
    return np.asarray(1.0 / (1.0 + square / _RETURN_PX**2), np.float32)


def looks_alike(current: ImageArray, brought: ImageArray) -> Float32Array:
    """1 where ``brought`` (H, W), warped onto ``current`` (H, W), correlates with it there."""
    x, y = current.astype(np.float32), brought.astype(np.float32)
    mean_x, mean_y = _local_mean(x), _local_mean(y)
    var_x = np.maximum(_local_mean(x * x) - mean_x * mean_x, 0.0)
    var_y = np.maximum(_local_mean(y * y) - mean_y * mean_y, 0.0)
    shared = _local_mean(x * y) - mean_x * mean_y
    correlation = shared / np.sqrt((var_x + _FAINT_GREY2) * (var_y + _FAINT_GREY2))
    return np.asarray(np.clip(correlation / _ALIKE_FULL, 0.0, 1.0), np.float32)


def stays_inside(flow: Float32Array) -> Float32Array:
    """1 where the flow (H, W, 2) leads to a point of the other picture, 0 elsewhere."""
    return lands_inside(flow).astype(np.float32)


def _local_mean(values: Float32Array) -> Float32Array:
    side = 2 * _ALIKE_RADIUS_PX + 1
    return cast(Float32Array, cv2.blur(values, (side, side)))
