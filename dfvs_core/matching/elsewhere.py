"""Another match of two images than a given one, as repeated structures have.

1. SIFT descriptors are matched, all pairs that follow the given flow left out.
2. A homography is fitted: what repeats does so along a plane, where a fundamental matrix would hold
   for each repetition. What was moved alone does not carry one over much of the view.
3. The dense search makes the homography's flow precise. It has to confirm as much of it as
   tracking would ask for.
"""

from typing import cast

import cv2
import numpy as np

from dfvs_core.geometry.arrays import Float32Array, ImageArray
from dfvs_core.matching.classical import (
    SiftFeatures,
    SiftPoints,
    mutual_distinct,
    squared_distance,
)
from dfvs_core.matching.config import PATCH_PX, MatchingConfig
from dfvs_core.matching.correspondence import FlowField, confident_ratio, exclude
from dfvs_core.matching.dense_search import search_residual
from dfvs_core.matching.warping import lands_inside, pixel_grid

_FAR_PX = 1e4
"""Longest vector of a homography that is kept; it leads out of any image."""


class SiftImage:
    """Image (H, W, 3) uint8 RGB, and its keypoints, found when first asked for."""

    def __init__(self, image: ImageArray, config: MatchingConfig) -> None:
        self.image, self._config = image, config
        self._features: SiftFeatures | None = None

    @property
    def grey(self) -> ImageArray:
        """The image in grey (H, W)."""
        return np.asarray(cv2.cvtColor(self.image, cv2.COLOR_RGB2GRAY), np.uint8)

    @property
    def features(self) -> SiftFeatures:
        """Keypoints and their descriptors."""
        if self._features is None:
            self._features = SiftPoints(self._config).encode(self.image)
        return self._features

    @property
    def has_features(self) -> bool:
        """Whether the keypoints were found."""
        return self._features is not None

    def prepare(self) -> bool:
        """Find the keypoints; whether that was still to be done."""
        was_done = self.has_features
        return not was_done and self.features is not None


def _squared_distance_px(first: Float32Array, second: Float32Array) -> Float32Array:
    """Squared distances (N, M) of points (N, 2) and (M, 2); works in place, as they are many."""
    squared, dv = (np.subtract.outer(first[:, k], second[:, k]) for k in (0, 1))
    squared *= squared
    dv *= dv
    squared += dv
    return cast(Float32Array, squared)


def match_elsewhere(
    current: SiftImage, other: SiftImage, flow: FlowField, config: MatchingConfig
) -> FlowField | None:
    """Flow between two images of one size that leads elsewhere than ``flow``, or None."""
    first, second = current.features, other.features
    u, v = np.rint(first.points).astype(np.intp).T
    ahead = first.points + flow.flow[v, u]
    squared = squared_distance(first, second)
    squared[_squared_distance_px(ahead, second.points) < PATCH_PX**2] = np.inf
    at, to = mutual_distinct(squared, config.sift_ratio).T
    if len(at) < config.least_matches:
        return None
    H, inliers = cv2.findHomography(
        first.points[at], second.points[to], cv2.USAC_MAGSAC, config.same_px
    )
    if H is None or np.count_nonzero(inliers) < config.least_matches:
        return None
    grid = pixel_grid(current.image.shape[:2])
    plane = np.nan_to_num(cv2.perspectiveTransform(grid, H) - grid).clip(-_FAR_PX, _FAR_PX)
    found = search_residual(current.grey, other.grey, plane, config)
    if confident_ratio(found) < config.kept_ratio * lands_inside(plane).mean():
        return None
    return exclude(found, [flow], config)
