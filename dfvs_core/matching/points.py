"""Sparse matches between two images, and the interface of their sources."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from typing import Protocol, TypeVar

import numpy as np

from dfvs_core.geometry.arrays import BoolArray, Float32Array, ImageArray, IntArray
from dfvs_core.matching.config import MatchingConfig
from dfvs_core.matching.correspondence import FlowField

Features = TypeVar("Features")


@dataclass(frozen=True, slots=True)
class PointMatches:
    """Points (N, 2) px of one image, the same points in another (N, 2), and confidence (N,).

    The centre of the first pixel is at (0, 0), as in OpenCV.
    """

    current: Float32Array
    other: Float32Array
    confidence: Float32Array

    def __len__(self) -> int:
        return len(self.current)

    def joined(self, others: PointMatches) -> PointMatches:
        """These and others."""
        return PointMatches(
            np.concatenate([self.current, others.current]),
            np.concatenate([self.other, others.other]),
            np.concatenate([self.confidence, others.confidence]),
        )

    def select(self, kept: BoolArray) -> PointMatches:
        """The matches of a mask (N,)."""
        return PointMatches(self.current[kept], self.other[kept], self.confidence[kept])

    def pixels(self, size: tuple[int, ...]) -> tuple[IntArray, IntArray]:
        """Rows and columns (N,) of the pixels of ``current`` in an image of ``size`` (H, W)."""
        last = np.array(size[1::-1]) - 1
        u, v = np.clip(np.rint(self.current).astype(np.intp), 0, last).T
        return v, u

    def miss_px(self, flow: Float32Array) -> Float32Array:
        """Distance (N,) of ``other`` from where a flow (H, W, 2) leads."""
        moved = flow[self.pixels(flow.shape)] - (self.other - self.current)
        return np.asarray(np.linalg.norm(moved, axis=1), np.float32)


NO_MATCHES = PointMatches(
    np.zeros((0, 2), np.float32), np.zeros((0, 2), np.float32), np.zeros(0, np.float32)
)
"""No points."""


def is_excluded(
    matches: PointMatches, excluded: Sequence[FlowField], config: MatchingConfig
) -> BoolArray:
    """Mask (N,) of the matches that lead to the same place as a flow that is excluded."""
    same = [matches.miss_px(wrong.flow) < config.same_px for wrong in excluded]
    return np.asarray(np.reshape(same, (len(excluded), len(matches))).any(axis=0), np.bool_)


Exclusion = Callable[[PointMatches], BoolArray]
"""Mask (N,) of the matches that are known to be wrong."""


class PointMatcher(Protocol[Features]):
    """Source of sparse matches: a network, or SIFT."""

    @property
    def width_px(self) -> int:
        """Largest width of an image that it makes use of."""
        ...

    def encode(self, image: ImageArray) -> Features:
        """What is matched of an image (H, W, 3) uint8 RGB."""
        ...

    def hypotheses(
        self, current: Features, other: Features, exclusion: Exclusion | None = None
    ) -> Iterator[PointMatches]:
        """Match hypotheses, the likeliest first; each is computed when it is asked for.

        Points are in px of the images. Unwanted matches may be left out, so that others of the
        same points of ``other`` are found.
        """
        ...

    def expected(
        self, current: Features, other: Features, turn_rad: float, scale: float
    ) -> PointMatches:
        """Some matches that take no longer than a frame may wait; there may be none.

        What is in ``current`` lies in ``other`` turned clockwise by about ``turn_rad``, and is
        about ``scale`` times as large.
        """
        ...
