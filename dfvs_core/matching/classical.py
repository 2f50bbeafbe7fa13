"""The built-in matcher: SIFT and a robust smooth model bridge large motion, DIS does the rest.

Warm, with the flow of the frame before, or with what a quick glance shows where little moved: fit
a smooth motion to that flow, refine it by dense inverse search, and see whether the result holds.
Cold, where there is no such flow or it does not hold: match features that agree with their
neighbours, fit a smooth motion, match again near its prediction, fit again, refine; then fit to
that flow and refine once more.
"""

from __future__ import annotations

from functools import cached_property
from typing import cast

import cv2
import numpy as np

from dfvs_core.arrays import Float32Array, ImageArray
from dfvs_core.correspondence import FlowField
from dfvs_core.errors import ImageError
from dfvs_core.matching.features import FeatureMatcher, Features, Matches, detect_features
from dfvs_core.matching.matcher import Prepared, check_image, check_same_size
from dfvs_core.matching.motion import SmoothMotion, fit_motion
from dfvs_core.matching.refinement import glance, refine
from dfvs_core.matching.warping import pixel_grid

_FEWEST_MATCHES = 8
_RATIO = 0.9
_NEAR_PX = 25.0

_SURE = 0.5
_GUESS_STRIDE = 16
_GUESS_CONFIDENCE = 0.3
_FEWEST_SAMPLES = 12
_APART_PX = 3.0
_SEAM_PX, _SEAM_LEAST = 2.0, 0.3
_KEPT_SHARE = 0.5
_LEAST_SHARE = 0.05
_GLANCE_SHARE = 0.1
_SETTLED_SHARE = 0.65
_COMMON_SHARE = 0.5


class ClassicalPicture(Prepared):
    """Grey picture (H, W), and its features, found when they are first asked for."""

    def __init__(self, image: ImageArray) -> None:
        check_image(image)
        super().__init__((image.shape[0], image.shape[1]))
        self.grey = cast(ImageArray, cv2.cvtColor(image, cv2.COLOR_RGB2GRAY))

    @cached_property
    def features(self) -> Features:
        """SIFT features: only a match without a good guess needs them."""
        return detect_features(self.grey)

    def slim(self) -> None:
        """Let go of the features."""
        self.__dict__.pop("features", None)


class ClassicalMatcher:
    """Dense correspondences without a network; see the module's text."""

    def prepare(self, image: ImageArray) -> ClassicalPicture:
        """Take a picture (H, W, 3) uint8 RGB."""
        return ClassicalPicture(image)

    def match(
        self, current: Prepared, other: Prepared, guess: FlowField | None = None
    ) -> FlowField:
        """Flow from ``current`` to ``other``; see :class:`Matcher`."""
        current, other = _check_pair(current, other)
        near = start_near(current, other) if guess is None else None
        return near or bridge(current, other)

    def track(self, current: Prepared, other: Prepared, guess: FlowField) -> FlowField | None:
        """Flow by a good guess alone; see :class:`Matcher`."""
        current, other = _check_pair(current, other)
        if not usable(guess, current.size):
            return None
        field = carry_on(current, other, guess)
        return field if field is not None and holds(field, guess) else None


def _check_pair(current: Prepared, other: Prepared) -> tuple[ClassicalPicture, ClassicalPicture]:
    """Refuse pictures of different sizes or of another matcher."""
    check_same_size(current, other)
    if not (isinstance(current, ClassicalPicture) and isinstance(other, ClassicalPicture)):
        raise ImageError("pictures were prepared by another matcher", "the same matcher's")
    return current, other


def sure_share(field: FlowField) -> float:
    """Share of the picture whose flow is more likely right than wrong."""
    return float(np.mean(field.confidence > _SURE))


def start_near(current: ClassicalPicture, other: ClassicalPicture) -> FlowField | None:
    """Match two pictures on the chance that little moved; None where the result is poor."""
    guess = glance(current.grey, other.grey)
    if sure_share(guess) < _GLANCE_SHARE:
        return None
    field = refit(current, other, guess)
    return field if field is not None and sure_share(field) >= _SETTLED_SHARE else None


def usable(guess: FlowField, size: tuple[int, int]) -> bool:
    """Whether a guess is of pictures of this size (height, width), and finite."""
    return guess.confidence.shape == size and guess.is_finite()


def holds(field: FlowField, guess: FlowField) -> bool:
    """Whether what came of a guess is about as sure as the guess was."""
    needed = max(_LEAST_SHARE, _KEPT_SHARE * min(sure_share(guess), _COMMON_SHARE))
    return sure_share(field) >= needed


def refit(current: ClassicalPicture, other: ClassicalPicture, guess: FlowField) -> FlowField | None:
    """Fit a smooth motion to what is trusted of a flow and refine it; None if that is little."""
    motion = smooth_motion(guess)
    return None if motion is None else refine(current.grey, other.grey, motion.flow())


def carry_on(
    current: ClassicalPicture, other: ClassicalPicture, guess: FlowField
) -> FlowField | None:
    """Refine the flow of the frame before, with all its surfaces; None if little is trusted."""
    motion = smooth_motion(guess)
    if motion is None:
        return None
    return refine(current.grey, other.grey, _with_other_surfaces(motion.flow(), guess))


def _with_other_surfaces(smooth: Float32Array, guess: FlowField) -> Float32Array:
    """Flow (H, W, 2), smooth but where ``guess`` is sure of something else.

    Where they are near, the smooth one is the more exact: it is free of the guess's noise.
    """
    apart = guess.flow - smooth
    square = np.einsum("hwc,hwc->hw", apart, apart)
    sure = np.clip((guess.confidence - _GUESS_CONFIDENCE) / (_SURE - _GUESS_CONFIDENCE), 0.0, 1.0)
    weight = sure * (square / (square + _APART_PX**2))
    own = cv2.GaussianBlur(weight[..., None] * apart, (0, 0), _SEAM_PX)
    total = cv2.GaussianBlur(weight, (0, 0), _SEAM_PX)[..., None]
    return np.asarray(smooth + own / np.maximum(total, _SEAM_LEAST), np.float32)


def smooth_motion(guess: FlowField) -> SmoothMotion | None:
    """Smooth motion fitted to what is trusted of a flow; None if that is little."""
    samples = _sample_flow(guess)
    if len(samples) < _FEWEST_SAMPLES:
        return None
    height, width = guess.confidence.shape
    return fit_motion(samples, (height, width))


def _sample_flow(field: FlowField) -> Matches:
    """Take the trusted vectors of a flow, a few hundred on a regular grid, as matches."""
    grid = (slice(_GUESS_STRIDE // 2, None, _GUESS_STRIDE),) * 2
    trusted = field.confidence[grid] > _GUESS_CONFIDENCE
    points = pixel_grid(field.confidence.shape[:2])[grid][trusted]
    return Matches(points, points + field.flow[grid][trusted])


def bridge(current: ClassicalPicture, other: ClassicalPicture) -> FlowField:
    """Match two pictures about whose relation nothing is known."""
    motion = _motion_from_features(current, other)
    if motion is None:
        nothing = np.zeros((*current.size, 2), np.float32)
        return FlowField(nothing, np.zeros(current.size, np.float32))
    first = refine(current.grey, other.grey, motion.flow())
    second = refit(current, other, first)
    if second is None or sure_share(second) < sure_share(first):
        return first
    return second


def _motion_from_features(
    current: ClassicalPicture, other: ClassicalPicture
) -> SmoothMotion | None:
    """Smooth motion that the features agree on, or None where too few do."""
    matcher = FeatureMatcher(current.features, other.features, current.size)
    matches = matcher.match(_RATIO)
    if len(matches) < _FEWEST_MATCHES:
        return None
    motion = fit_motion(matches, current.size)
    nearby = matcher.match_near(motion.at(current.features.points), _NEAR_PX, _RATIO)
    if len(nearby) < len(matches):
        return motion
    return fit_motion(nearby, current.size)
