"""Classical baseline: sparse RootSIFT matches.

RootSIFT: Arandjelovic and Zisserman, CVPR 2012. Local contrast is equalised first, as dark plain
walls hold texture that is too faint for the detector.
"""

from collections.abc import Iterator
from dataclasses import dataclass
from typing import cast

import cv2
import numpy as np
from numpy.typing import NDArray

from dfvs_core.geometry.arrays import Float32Array, ImageArray
from dfvs_core.matching.config import MatchingConfig
from dfvs_core.matching.points import NO_MATCHES, Exclusion, PointMatches
from dfvs_core.matching.staged import StagedMatcher


@dataclass(frozen=True, slots=True)
class SiftFeatures:
    """Points (N, 2) px of the image, and descriptors (N, 128) of unit length."""

    points: Float32Array
    descriptors: Float32Array


class SiftPoints:
    """Mutual nearest RootSIFT descriptors that pass Lowe's ratio test; one hypothesis."""

    def __init__(self, config: MatchingConfig) -> None:
        self._config = config

    @property
    def width_px(self) -> int:
        """Largest width of an image that it makes use of."""
        return self._config.sift_width_px

    def encode(self, image: ImageArray) -> SiftFeatures:
        """Features of an image (H, W, 3) uint8 RGB, no wider than ``width_px``."""
        grey = cast(ImageArray, cv2.cvtColor(image, cv2.COLOR_RGB2GRAY))
        sift = cv2.SIFT.create(self._config.sift_count)
        keypoints, raw = sift.detectAndCompute(cv2.createCLAHE().apply(grey), None)
        points = np.array([k.pt for k in keypoints], np.float32).reshape(-1, 2)
        if raw is None:
            raw = np.zeros((0, 128), np.float32)
        descriptors = np.sqrt(raw / np.maximum(raw.sum(axis=1, keepdims=True), 1e-6))
        return SiftFeatures(points, descriptors.astype(np.float32))

    def hypotheses(
        self, current: SiftFeatures, other: SiftFeatures, exclusion: Exclusion | None = None
    ) -> Iterator[PointMatches]:
        """The matches, all of equal confidence; see ``dfvs_core.matching.points``."""
        squared = squared_distance(current, other)
        pairs = mutual_distinct(squared, self._config.sift_ratio)
        at, to = current.points[pairs[:, 0]], other.points[pairs[:, 1]]
        # SIFT gives a point once per orientation: keep each place once
        _, once = np.unique(np.round(at), axis=0, return_index=True)
        once.sort()
        yield PointMatches(at[once], to[once], np.ones(len(once), np.float32))

    def expected(
        self, current: SiftFeatures, other: SiftFeatures, turn_rad: float, scale: float
    ) -> PointMatches:
        """No matches: SIFT takes too long between frames."""
        return NO_MATCHES


def classical_matcher(config: MatchingConfig | None = None) -> StagedMatcher[SiftFeatures]:
    """The matcher that needs no network."""
    config = config or MatchingConfig()
    return StagedMatcher(SiftPoints(config), config)


def squared_distance(first: SiftFeatures, second: SiftFeatures) -> Float32Array:
    """Squared distance (N, M) of each descriptor of one image from each of another."""
    distance = np.matmul(first.descriptors, -2.0 * second.descriptors.T)
    distance += 2.0
    return np.asarray(np.maximum(distance, 0.0, out=distance), np.float32)


def mutual_distinct(squared: Float32Array, ratio: float) -> NDArray[np.intp]:
    """Indices (K, 2) of mutual nearest descriptors, nearer than ``ratio`` times the second.

    ``squared`` (N, M) holds their squared distances.
    """
    if min(squared.shape) < 2:
        return np.zeros((0, 2), np.intp)
    row = np.arange(len(squared))
    nearest = squared.argmin(axis=1)
    best = squared[row, nearest]
    kept = best <= squared.min(axis=0)[nearest]
    others = squared.copy()
    others[row, nearest] = np.inf
    kept &= best < ratio**2 * others.min(axis=1)
    return np.column_stack([row[kept], nearest[kept]])
