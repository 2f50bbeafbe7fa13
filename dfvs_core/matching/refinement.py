"""From a coarse flow to a precise one, and how far each of its vectors can be trusted."""

from __future__ import annotations

from typing import cast

import cv2
import numpy as np

from dfvs_core.arrays import BoolArray, Float32Array, ImageArray
from dfvs_core.correspondence import FlowField
from dfvs_core.matching.trust import looks_alike, returns, stays_inside
from dfvs_core.matching.warping import bring, compose, lands_inside, pixel_grid, sample

_ROAM_PX = 4.0

_THERE_ROUNDS, _BACK_ROUNDS = 8, 4
"""Rounds of smoothing, half of the time of a search. The way back is a witness only."""
_PATCH_STRIDE_PX = 4
"""From patch to patch of 8 px; OpenCV's preset has 3, which takes longer and finds no more. With 5
two of the benchmark's ten flights lose the proof of their first motion."""

_GAIN_LIMITS = (0.5, 2.0)
_GAIN_STRIDE = 4
_GAIN_ROUNDS = 3
_FEWEST_GREYS = 100


def glance(current: ImageArray, other: ImageArray) -> FlowField:
    """Flow of small motion between two grey pictures (H, W), coarse but quick."""
    return _refine(current, other, _still(current), _coarse_search(), _coarse_search())


def refine(current: ImageArray, other: ImageArray, start: Float32Array) -> FlowField:
    """Refine the flow ``start`` (H, W, 2) between two grey pictures (H, W).

    The other picture is warped by ``start`` and its brightness fitted, dense inverse search
    finds what is left of the motion, both ways, and the flows are chained.
    """
    searches = _fine_search(_THERE_ROUNDS), _fine_search(_BACK_ROUNDS)
    return _refine(current, other, start, *searches)


def _refine(
    current: ImageArray,
    other: ImageArray,
    start: Float32Array,
    way_there: cv2.DISOpticalFlow,
    way_back: cv2.DISOpticalFlow,
) -> FlowField:
    at = pixel_grid(current.shape[:2])
    aligned = _fit_brightness(current, bring(other, start), lands_inside(start))
    there = _search(way_there, current, aligned)
    back = _search(way_back, aligned, current)
    flow = compose(there, start)
    confidence = returns(there, back) * looks_alike(current, sample(aligned, at + there))
    confidence *= _stays_near(there) * stays_inside(flow)
    return FlowField(flow, confidence)


def _fine_search(rounds: int) -> cv2.DISOpticalFlow:
    """Dense inverse search (Kroeger et al. 2016) down to half resolution, smoothed.

    Twice as smooth as OpenCV's preset: plain walls say little, and what they say is noise.
    """
    dis = cv2.DISOpticalFlow.create(cv2.DISOPTICAL_FLOW_PRESET_MEDIUM)
    dis.setPatchStride(_PATCH_STRIDE_PX)
    dis.setVariationalRefinementAlpha(40.0)
    dis.setVariationalRefinementIterations(rounds)
    return dis


def _coarse_search() -> cv2.DISOpticalFlow:
    """Dense inverse search down to a quarter of the resolution, a fifth of the time."""
    return cv2.DISOpticalFlow.create(cv2.DISOPTICAL_FLOW_PRESET_FAST)


def _search(dis: cv2.DISOpticalFlow, current: ImageArray, other: ImageArray) -> Float32Array:
    """Flow (H, W, 2) between grey pictures, searched from standstill."""
    return cast(Float32Array, dis.calc(current, other, _still(current)))


def _still(picture: ImageArray) -> Float32Array:
    return np.zeros((*picture.shape, 2), np.float32)


def _stays_near(there: Float32Array) -> Float32Array:
    """1 where the search went where most of the picture went, 0.5 at some pixels from there.

    What roams far from a smooth start has more often found a wrong place than a near object.
    """
    roam = there - np.median(there[4::8, 4::8], axis=(0, 1)).astype(np.float32)
    square = np.einsum("hwc,hwc->hw", roam, roam)
    return np.asarray(1.0 / (1.0 + square / _ROAM_PX**2), np.float32)


def _fit_brightness(current: ImageArray, aligned: ImageArray, seen: BoolArray) -> ImageArray:
    """Take the gain and offset of ``current`` to ``aligned``, over what both have seen.

    From spreads, not by regression: a regression's slope shrinks where the pictures are not
    aligned yet.
    """
    grid = (slice(_GAIN_STRIDE // 2, None, _GAIN_STRIDE),) * 2
    x = aligned[grid][seen[grid]].astype(np.float32)
    y = current[grid][seen[grid]].astype(np.float32)
    if len(x) < _FEWEST_GREYS:
        return aligned
    kept = np.ones(len(x), dtype=np.bool_)
    gain, offset = 1.0, 0.0
    for _ in range(_GAIN_ROUNDS):
        gain = float(np.clip((y[kept].std() + 0.5) / (x[kept].std() + 0.5), *_GAIN_LIMITS))
        offset = float(np.median(y[kept] - gain * x[kept]))
        miss = np.abs(gain * x + offset - y)
        kept = miss <= 3.0 * np.median(miss) + 2.0
    table = np.clip(gain * np.arange(256) + offset, 0.0, 255.0).astype(np.uint8)
    return cast(ImageArray, cv2.LUT(aligned, table))
