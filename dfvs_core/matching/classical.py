"""The built-in matcher: SIFT and a robust model bridge large motion, DIS does the rest.

Steps: even out the local contrast; match RootSIFT features; fit a homography (MAGSAC); warp the
other picture by it; find the rest by dense inverse search (DIS, Kroeger et al. 2016) in both
directions; chain the flows; trust what returns to where it came from.
"""

from __future__ import annotations

from functools import cached_property
from typing import cast

import cv2
import numpy as np

from dfvs_core.arrays import Float32Array, FloatArray, ImageArray
from dfvs_core.correspondence import FlowField
from dfvs_core.errors import ImageError
from dfvs_core.matching.features import (
    Features,
    Matches,
    detect,
    even_contrast,
    match_features,
)
from dfvs_core.matching.matcher import Prepared, check_image, check_same_size
from dfvs_core.matching.warping import (
    compose,
    homography_flow,
    lands_inside,
    pixel_grid,
    sample,
)

_MAX_FEATURES = 1500
_MIN_INLIERS = 8
_INLIER_PX = 3.0
_RETURN_PX = 1.0


class ClassicalPicture(Prepared):
    """Evened picture, and its features, found when they are first asked for."""

    def __init__(self, image: ImageArray) -> None:
        check_image(image)
        super().__init__(image.shape[:2])
        self.even = even_contrast(image)

    @cached_property
    def features(self) -> Features:
        """SIFT features: only a match without a good guess needs them."""
        return detect(self.even, _MAX_FEATURES)


class ClassicalMatcher:
    """Dense correspondences without a network; see the module's text."""

    def prepare(self, image: ImageArray) -> ClassicalPicture:
        """Even out the contrast of a picture (H, W, 3) uint8 RGB."""
        return ClassicalPicture(image)

    def match(
        self, current: Prepared, other: Prepared, guess: FlowField | None = None
    ) -> FlowField:
        """Flow from ``current`` to ``other``; see :class:`Matcher`."""
        check_same_size(current, other)
        if not (isinstance(current, ClassicalPicture) and isinstance(other, ClassicalPicture)):
            raise ImageError("pictures were prepared by another matcher", "the same matcher's")
        matches = match_features(current.features, other.features)
        H = fit_homography(matches)
        start = homography_flow(np.eye(3) if H is None else H, current.size)
        field = refine(current.even, other.even, start)
        if H is None:
            return FlowField(field.flow, np.float32(0.2) * field.confidence)
        return field


def fit_homography(matches: Matches) -> FloatArray | None:
    """Homography (3, 3) from matches with gross errors (MAGSAC), or None where none holds."""
    if len(matches) < _MIN_INLIERS:
        return None
    cv2.setRNGSeed(0)
    H, kept = cv2.findHomography(matches.current, matches.other, cv2.USAC_MAGSAC, _INLIER_PX)
    if H is None or int(kept.sum()) < _MIN_INLIERS:
        return None
    return np.asarray(H, dtype=np.float64)


def refine(current: ImageArray, other: ImageArray, start: Float32Array) -> FlowField:
    """Refine the flow ``start`` (H, W, 2) by DIS on the aligned pair, checked both ways."""
    at = pixel_grid(current.shape[:2])
    aligned = sample(other, at + start)
    there = search(current, aligned)
    back = search(aligned, current)
    miss = np.linalg.norm(there + sample(back, at + there), axis=-1)
    flow = compose(there, start)
    confidence = np.exp(-0.5 * (miss / _RETURN_PX) ** 2) * lands_inside(flow)
    return FlowField(flow, confidence.astype(np.float32))


def search(current: ImageArray, other: ImageArray) -> Float32Array:
    """Flow (H, W, 2) of small motion between two grey pictures (H, W), by DIS."""
    dis = cv2.DISOpticalFlow.create(cv2.DISOPTICAL_FLOW_PRESET_MEDIUM)
    flow = np.zeros((*current.shape, 2), np.float32)
    return cast(Float32Array, dis.calc(current, other, flow))
