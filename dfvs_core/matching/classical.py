"""The built-in matcher: SIFT and a robust smooth model bridge large motion, DIS does the rest.

Warm, with the flow of the frame before, or with what a quick glance shows where little moved: fit
a smooth motion to that flow, refine it by dense inverse search, and see whether the result holds.
Cold, where there is no such flow or it does not hold: match features that agree with their
neighbours, fit smooth motions to those of one surface after the other, refine each, and take the
one that most speaks for. What is unsure of a first match is searched along epipolar lines.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from functools import cached_property
from typing import cast

import cv2
import numpy as np

from dfvs_core.arrays import Float32Array, ImageArray
from dfvs_core.correspondence import FlowField
from dfvs_core.errors import ImageError
from dfvs_core.matching.closer_look import part_around
from dfvs_core.matching.completion import search_lines
from dfvs_core.matching.features import Features, detect_features
from dfvs_core.matching.matcher import Prepared, check_image, check_same_size
from dfvs_core.matching.merit import assessed, best_of, passing_over
from dfvs_core.matching.motion import motion_of
from dfvs_core.matching.refinement import glance, refine
from dfvs_core.matching.sureness import nothing, sure_share, surer
from dfvs_core.matching.surfaces import surface_flows
from dfvs_core.matching.texture import has_texture

_SURE = 0.5
_GUESS_CONFIDENCE = 0.3
_APART_PX = 3.0
_SEAM_PX, _SEAM_LEAST = 2.0, 0.3
_KEPT_SHARE = 0.5
_LEAST_SHARE = 0.05
_GLANCE_SHARE = 0.1
_SETTLED_SHARE = 0.65
_COMMON_SHARE = 0.5


class ClassicalPicture(Prepared):
    """Picture (H, W, 3), grey (H, W), and its features, found when they are first asked for."""

    def __init__(self, image: ImageArray) -> None:
        check_image(image)
        super().__init__((image.shape[0], image.shape[1]))
        self.image = image
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
        self,
        current: Prepared,
        other: Prepared,
        guess: FlowField | None = None,
        *,
        besides: Sequence[FlowField] = (),
    ) -> FlowField:
        """Flow from ``current`` to ``other``; see :class:`Matcher`."""
        current, other = _check_pair(current, other)
        near = start_near(current, other) if guess is None and not besides else None
        field = search_lines(current, other, near or bridge(current, other, besides))
        return passing_over(field, besides)

    def track(self, current: Prepared, other: Prepared, guess: FlowField) -> FlowField | None:
        """Flow by a good guess alone; see :class:`Matcher`."""
        current, other = _check_pair(current, other)
        if not usable(guess, current.size):
            return None
        part = part_around(guess)
        if part is None:
            return self._track(current, other, guess)
        field = self._track(self.prepare(part.cut(current.image)), other, part.of(guess))
        return None if field is None else part.whole(field)

    def _track(
        self, current: ClassicalPicture, other: ClassicalPicture, guess: FlowField
    ) -> FlowField | None:
        field = carry_on(current, other, guess)
        if field is None or holds(field, guess):
            return field
        # where little is sure noise shakes its fit; what came of that often fits better
        again = carry_on(current, other, field)
        return again if again is not None and holds(again, guess) else None


def _check_pair(current: Prepared, other: Prepared) -> tuple[ClassicalPicture, ClassicalPicture]:
    """Refuse pictures of different sizes or of another matcher."""
    check_same_size(current, other)
    if not (isinstance(current, ClassicalPicture) and isinstance(other, ClassicalPicture)):
        raise ImageError("pictures were prepared by another matcher", "the same matcher's")
    return current, other


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
    motion = motion_of(guess)
    return None if motion is None else refine(current.grey, other.grey, motion.flow())


def carry_on(
    current: ClassicalPicture, other: ClassicalPicture, guess: FlowField
) -> FlowField | None:
    """Refine the flow of the frame before, with all its surfaces; None if little is trusted."""
    motion = motion_of(guess)
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


def bridge(
    current: ClassicalPicture, other: ClassicalPicture, besides: Sequence[FlowField]
) -> FlowField:
    """Match two pictures about whose relation nothing is known, but perhaps what it is not."""
    starts = feature_starts(current, other)
    fields = (passing_over(refine_twice(current, other, start), besides) for start in starts)
    textured = has_texture(current.grey)
    best = best_of(assessed(field, textured) for field in fields)
    return nothing(current.size) if best is None else best.field


def feature_starts(current: ClassicalPicture, other: ClassicalPicture) -> Iterator[Float32Array]:
    """Flows (H, W, 2) to begin with, of one surface each, by features; made as asked for."""
    yield from surface_flows(current.features, other.features, current.size)


def refine_twice(
    current: ClassicalPicture, other: ClassicalPicture, start: Float32Array
) -> FlowField:
    """Refine a flow, and once more from what the first time made precise; the surer one."""
    first = refine(current.grey, other.grey, start)
    second = refit(current, other, first)
    return first if second is None else surer(first, second)
