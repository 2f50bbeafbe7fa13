"""Dense inverse search from a predicted flow, and the confidence of each of its vectors.

1. Warp the other image backwards by the prediction, and match its brightness.
2. Search the residual motion both ways (DIS, Kroeger et al., ECCV 2016).
3. Compose the residual with the prediction.
4. Confidence is the product of forward-backward consistency, normalised cross-correlation, and the
   in-bounds mask.
"""

from __future__ import annotations

from typing import cast

import cv2
import numpy as np

from dfvs_core.arrays import BoolArray, Float32Array, ImageArray
from dfvs_core.correspondence import FlowField
from dfvs_core.matching.config import PATCH_PX, MatchingConfig
from dfvs_core.matching.warping import backward_warp, compose, lands_inside, pixel_grid, sample

_ROUNDING_GREY2 = 1.0 / 12.0
"""Variance of rounding to whole greys: a plain window does not correlate with noise."""


def search_residual(
    current: ImageArray, other: ImageArray, predicted: Float32Array, config: MatchingConfig
) -> FlowField:
    """Flow between two grey images (H, W), searched around a predicted flow (H, W, 2)."""
    warped = backward_warp(other, predicted)
    aligned = _match_brightness(current, warped, lands_inside(predicted))
    forward = _search(current, aligned)
    backward = _search(aligned, current)
    flow = compose(forward, predicted)
    confidence = forward_backward_consistency(forward, backward, config)
    warped = sample(aligned, pixel_grid(current.shape[:2]) + forward)
    confidence *= np.maximum(normalised_cross_correlation(current, warped), 0.0)
    return FlowField(flow, confidence * lands_inside(flow))


def forward_backward_consistency(
    forward: Float32Array, backward: Float32Array, config: MatchingConfig
) -> Float32Array:
    """(H, W): 1 where both flows lead back to the start, 0.5 one standard deviation beside it."""
    miss = compose(forward, backward)
    square = np.einsum("hwc,hwc->hw", miss, miss)
    return np.asarray(1.0 / (1.0 + square / config.noise_px**2), np.float32)


def normalised_cross_correlation(current: ImageArray, warped: ImageArray) -> Float32Array:
    """Correlation (H, W), -1 to 1, of the patches around each pixel of two grey images.

    It is 0 where there is no texture.
    """
    side = (PATCH_PX + 1, PATCH_PX + 1)
    x, y = current.astype(np.float32), warped.astype(np.float32)
    mean_x, mean_y = cv2.blur(x, side), cv2.blur(y, side)
    var_x = np.maximum(cv2.blur(x * x, side) - mean_x * mean_x, 0.0)
    var_y = np.maximum(cv2.blur(y * y, side) - mean_y * mean_y, 0.0)
    shared = cv2.blur(x * y, side) - mean_x * mean_y
    correlation = shared / np.sqrt((var_x + _ROUNDING_GREY2) * (var_y + _ROUNDING_GREY2))
    return np.asarray(correlation, np.float32)


def _search(current: ImageArray, other: ImageArray) -> Float32Array:
    """Flow (H, W, 2) between grey images, searched from standstill."""
    dis = cv2.DISOpticalFlow.create(cv2.DISOPTICAL_FLOW_PRESET_MEDIUM)
    dis.setPatchStride(PATCH_PX // 2)
    return cast(Float32Array, dis.calc(current, other, np.zeros((*current.shape, 2), np.float32)))


def _match_brightness(current: ImageArray, warped: ImageArray, inside: BoolArray) -> ImageArray:
    """Warped image with the mean and spread of ``current``, over what both show.

    A regression's slope would shrink where images are not aligned.
    """
    mask = inside.astype(np.uint8)
    (mean, spread), (mean_warped, spread_warped) = (
        np.ravel(cv2.meanStdDev(image, mask=mask)) for image in (current, warped)
    )
    gain = (spread + 1.0) / (spread_warped + 1.0)
    table = np.clip(gain * (np.arange(256) - mean_warped) + mean, 0.0, 255.0)
    return cast(ImageArray, cv2.LUT(warped, table.astype(np.uint8)))
