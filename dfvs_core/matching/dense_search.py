"""Dense inverse search from a predicted flow, and the confidence of each of its vectors.

1. Warp the other image backwards by the prediction, and fit its gain and offset.
2. Search the residual motion both ways (DIS, Kroeger et al., ECCV 2016).
3. Compose the residual with the prediction.
4. Confidence is the product of forward-backward consistency, normalised cross-correlation,
   nearness to the median residual, and the in-bounds mask.
"""

from __future__ import annotations

from typing import cast

import cv2
import numpy as np

from dfvs_core.arrays import BoolArray, Float32Array, ImageArray
from dfvs_core.correspondence import FlowField
from dfvs_core.matching.config import MatchingConfig
from dfvs_core.matching.warping import backward_warp, compose, lands_inside, pixel_grid, sample

_GAIN_LIMITS = (0.5, 2.0)
_GAIN_STRIDE_PX = 4
_GAIN_ROUNDS = 3
_FEWEST_GREYS = 100
_FAINT_GREY2 = 0.1
"""Variance that keeps a plain window from correlating with noise."""


def search_residual(
    current: ImageArray, other: ImageArray, predicted: Float32Array, config: MatchingConfig
) -> FlowField:
    """Flow between two grey images (H, W), searched around a predicted flow (H, W, 2)."""
    at = pixel_grid(current.shape[:2])
    warped = backward_warp(other, predicted)
    aligned = _fit_brightness(current, warped, lands_inside(predicted))
    forward = _search(current, aligned, config.forward_rounds, config)
    backward = _search(aligned, current, config.backward_rounds, config)
    flow = compose(forward, predicted)
    confidence = forward_backward_consistency(forward, backward, config.forward_backward_px)
    confidence *= correlation_confidence(current, sample(aligned, at + forward), config)
    confidence *= _near_median(forward, config.deviation_px) * lands_inside(flow)
    return FlowField(flow, confidence)


def forward_backward_consistency(
    forward: Float32Array, backward: Float32Array, half_px: float
) -> Float32Array:
    """(H, W): 1 where both flows lead back to the start, 0.5 ``half_px`` away from it."""
    at = pixel_grid((forward.shape[0], forward.shape[1]))
    return _half_at(forward + sample(backward, at + forward), half_px)


def correlation_confidence(
    current: ImageArray, warped: ImageArray, config: MatchingConfig
) -> Float32Array:
    """(H, W): 1 where ``warped`` (H, W) correlates with ``current`` (H, W), 0 without texture."""
    correlation = normalised_cross_correlation(current, warped, config.correlation_radius_px)
    return np.asarray(np.clip(correlation / config.full_correlation, 0.0, 1.0), np.float32)


def normalised_cross_correlation(
    current: ImageArray, warped: ImageArray, radius_px: int
) -> Float32Array:
    """Correlation (H, W), -1 to 1, of the windows around each pixel of two grey images."""
    side = (2 * radius_px + 1, 2 * radius_px + 1)
    x, y = current.astype(np.float32), warped.astype(np.float32)
    mean_x, mean_y = cv2.blur(x, side), cv2.blur(y, side)
    var_x = np.maximum(cv2.blur(x * x, side) - mean_x * mean_x, 0.0)
    var_y = np.maximum(cv2.blur(y * y, side) - mean_y * mean_y, 0.0)
    shared = cv2.blur(x * y, side) - mean_x * mean_y
    correlation = shared / np.sqrt((var_x + _FAINT_GREY2) * (var_y + _FAINT_GREY2))
    return np.asarray(correlation, np.float32)


def _near_median(residual: Float32Array, half_px: float) -> Float32Array:
    """(H, W): 1 at the median of the residual motion, 0.5 ``half_px`` away from it."""
    median = np.median(residual[4::8, 4::8], axis=(0, 1)).astype(np.float32)
    return _half_at(residual - median, half_px)


def _half_at(miss: Float32Array, half_px: float) -> Float32Array:
    square = np.einsum("hwc,hwc->hw", miss, miss)
    return np.asarray(1.0 / (1.0 + square / half_px**2), np.float32)


def _search(
    current: ImageArray, other: ImageArray, rounds: int, config: MatchingConfig
) -> Float32Array:
    """Flow (H, W, 2) between grey images, searched from standstill."""
    dis = cv2.DISOpticalFlow.create(cv2.DISOPTICAL_FLOW_PRESET_MEDIUM)
    dis.setPatchStride(config.patch_stride_px)
    dis.setVariationalRefinementAlpha(config.smoothness)
    dis.setVariationalRefinementIterations(rounds)
    return cast(Float32Array, dis.calc(current, other, np.zeros((*current.shape, 2), np.float32)))


def _fit_brightness(current: ImageArray, warped: ImageArray, inside: BoolArray) -> ImageArray:
    """Warped image with the gain and offset of ``current``, over what both show.

    The gain is the ratio of the spreads: a regression's slope shrinks where images are not aligned.
    """
    grid = (slice(_GAIN_STRIDE_PX // 2, None, _GAIN_STRIDE_PX),) * 2
    x = warped[grid][inside[grid]].astype(np.float32)
    y = current[grid][inside[grid]].astype(np.float32)
    if len(x) < _FEWEST_GREYS:
        return warped
    kept = np.ones(len(x), dtype=np.bool_)
    gain, offset = 1.0, 0.0
    for _ in range(_GAIN_ROUNDS):
        gain = float(np.clip((y[kept].std() + 0.5) / (x[kept].std() + 0.5), *_GAIN_LIMITS))
        offset = float(np.median(y[kept] - gain * x[kept]))
        miss = np.abs(gain * x + offset - y)
        kept = miss <= 3.0 * np.median(miss) + 2.0
    table = np.clip(gain * np.arange(256) + offset, 0.0, 255.0).astype(np.uint8)
    return cast(ImageArray, cv2.LUT(warped, table))
