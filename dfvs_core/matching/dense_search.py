"""Dense inverse search from a predicted flow, with a confidence per vector.

1. Warp the other image backwards by the prediction, and match its brightness.
2. Search the residual motion both ways (DIS, Kroeger et al., ECCV 2016).
3. Compose the residual with the prediction.
4. Confidence is the product of forward-backward consistency, normalised cross-correlation,
   nearness to the median residual of what these two are confident of, and the in-bounds mask.
"""

from typing import cast

import cv2
import numpy as np

from dfvs_core.geometry.arrays import BoolArray, Float32Array, ImageArray
from dfvs_core.matching.config import PATCH_PX, MatchingConfig
from dfvs_core.matching.correspondence import CONFIDENT, FlowField
from dfvs_core.matching.warping import backward_warp, compose, lands_inside, pixel_grid, sample

_SOME = (slice(None, None, 4), slice(None, None, 4))
"""Pixels of an image whose medians stand for those of all."""

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
    confident = forward[_SOME][confidence[_SOME] > CONFIDENT]
    if len(confident):
        median = np.median(confident, axis=0).astype(np.float32)
        confidence *= _half_at(forward - median, config.residual_sigmas * config.noise_px)
    return FlowField(flow, confidence * lands_inside(flow))


def forward_backward_consistency(
    forward: Float32Array, backward: Float32Array, config: MatchingConfig
) -> Float32Array:
    """(H, W): 1 where both flows lead back to the start, 0.5 one standard deviation beside it."""
    return _half_at(compose(forward, backward), config.noise_px)


def _half_at(miss: Float32Array, half_px: float) -> Float32Array:
    """(H, W): 1 where ``miss`` (H, W, 2) is nothing, 0.5 where it is ``half_px`` long."""
    u, v = miss[..., 0], miss[..., 1]
    return np.asarray(1.0 / (1.0 + (u * u + v * v) / np.float32(half_px**2)), np.float32)


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
    """Warped image with the gain and offset of ``current``, over most of what both show.

    The gain is the ratio of the spreads: a regression's slope shrinks where images are not aligned.
    """
    x, y = (image[_SOME][inside[_SOME]].astype(np.float32) for image in (warped, current))
    if len(x) == 0:
        return warped
    kept = np.ones(len(x), np.bool_)
    for _ in range(3):  # what both show is not all alike
        gain = (y[kept].std() + 1.0) / (x[kept].std() + 1.0)
        offset = np.median(y[kept] - gain * x[kept])
        miss = np.abs(gain * x + offset - y)
        kept = miss <= 3.0 * np.median(miss)
    table = np.clip(gain * np.arange(256) + offset, 0.0, 255.0).astype(np.uint8)
    return cast(ImageArray, cv2.LUT(warped, table))
