"""The classical baseline: sparse matches of RootSIFT features, without a network.

RootSIFT: Arandjelovic and Zisserman, CVPR 2012. Local contrast is evened out first, as dark plain
walls hold texture that is too faint for the detector.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from typing import cast

import cv2
import numpy as np
from numpy.typing import NDArray

from dfvs_core.arrays import Float32Array, ImageArray
from dfvs_core.matching.config import MatchingConfig
from dfvs_core.matching.points import PointMatches, Unwanted
from dfvs_core.matching.staged import StagedMatcher

_MEAN_SIGMA_PX, _SPREAD_SIGMA_PX = 12.0, 16.0
_NOISE_GREY, _GREY_PER_SPREAD = 1.5, 45.0
_WIDTH_PX, _MOST_ENLARGED = 640, 2.0
"""Images are brought to this width: what is far off in one of two images is small there."""
_COUNT, _CONTRAST, _EDGE_RATIO = 3000, 0.015, 15.0
_RATIO = 0.9


@dataclass(frozen=True, slots=True)
class SiftFeatures:
    """Points (N, 2) px of the image, and descriptors (N, 128) of unit length."""

    points: Float32Array
    descriptors: Float32Array


class SiftPoints:
    """Mutual nearest RootSIFT descriptors that pass Lowe's ratio test; one hypothesis."""

    width_px = _WIDTH_PX

    def encode(self, image: ImageArray) -> SiftFeatures:
        """Features of an image (H, W, 3) uint8 RGB, no wider than ``width_px``."""
        grey = cast(ImageArray, cv2.cvtColor(image, cv2.COLOR_RGB2GRAY))
        scale = min(_MOST_ENLARGED, _WIDTH_PX / grey.shape[1])
        even = even_contrast(grey)
        even = cast(
            ImageArray, cv2.resize(even, None, fx=scale, fy=scale, interpolation=cv2.INTER_CUBIC)
        )
        sift = cv2.SIFT.create(_COUNT, contrastThreshold=_CONTRAST, edgeThreshold=_EDGE_RATIO)
        keypoints, raw = sift.detectAndCompute(even, None)
        points = np.array([k.pt for k in keypoints], np.float32).reshape(-1, 2)
        if raw is None:
            raw = np.zeros((0, 128), np.float32)
        descriptors = np.sqrt(raw / np.maximum(raw.sum(axis=1, keepdims=True), 1e-6))
        at = (points + 0.5) / scale - 0.5
        return SiftFeatures(at.astype(np.float32), descriptors.astype(np.float32))

    def hypotheses(
        self, current: SiftFeatures, other: SiftFeatures, unwanted: Unwanted | None = None
    ) -> Iterator[PointMatches]:
        """The matches, all of equal confidence; see ``dfvs_core.matching.points``."""
        pairs = _mutual_distinct(current.descriptors, other.descriptors)
        at, to = current.points[pairs[:, 0]], other.points[pairs[:, 1]]
        # SIFT gives a point once per orientation: keep each place once
        _, once = np.unique(np.round(at), axis=0, return_index=True)
        once.sort()
        yield PointMatches(at[once], to[once], np.ones(len(once), np.float32))


def classical_matcher(config: MatchingConfig | None = None) -> StagedMatcher[SiftFeatures]:
    """The matcher that needs no network."""
    return StagedMatcher(SiftPoints(), config)


def even_contrast(grey: ImageArray) -> ImageArray:
    """Grey image (H, W) uint8 with its local mean and spread made equal everywhere."""
    values = grey.astype(np.float32)
    centred = values - cv2.GaussianBlur(values, (0, 0), _MEAN_SIGMA_PX)
    spread = np.sqrt(cv2.GaussianBlur(centred * centred, (0, 0), _SPREAD_SIGMA_PX))
    even = 128.0 + _GREY_PER_SPREAD * centred / (spread + _NOISE_GREY)
    return np.clip(even, 0.0, 255.0).astype(np.uint8)


def _mutual_distinct(first: Float32Array, second: Float32Array) -> NDArray[np.intp]:
    """Indices (N, 2) of mutual nearest descriptors whose distance beats the second's."""
    none = np.zeros((0, 2), np.intp)
    if min(len(first), len(second)) < 2:
        return none
    matcher = cv2.BFMatcher(cv2.NORM_L2)
    there = matcher.knnMatch(first, second, k=2)
    back = {m[0].queryIdx: m[0].trainIdx for m in matcher.knnMatch(second, first, k=1)}
    kept = [
        (m.queryIdx, m.trainIdx)
        for m, n in there
        if m.distance < _RATIO * n.distance and back[m.trainIdx] == m.queryIdx
    ]
    return np.array(kept, np.intp).reshape(-1, 2) if kept else none
