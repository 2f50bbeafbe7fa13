"""Sparse features: RootSIFT on a picture whose local contrast was evened out, and their matches.

Points are in OpenCV's pixel coordinates, the first pixel's centre at (0, 0).
"""

from __future__ import annotations

from dataclasses import dataclass

import cv2
import numpy as np
from numpy.typing import NDArray

from dfvs_core.arrays import BoolArray, Float32Array, ImageArray
from dfvs_core.matching.products import outer_product

_MEAN_SIGMA_PX = 12.0
_SPREAD_SIGMA_PX = 16.0
_NOISE_GREY = 1.5
_GREY_PER_SPREAD = 45.0

_MAX_COUNT = 800
_CONTRAST = 0.015
_EDGE_RATIO = 15.0

_AGREE_PX = 3.0
_AGREE_SHARE = 0.25
_AGREE_RADIUS_DIAGONALS = 0.2
_AGREE_COUNT = 2
_AGREE_ROUNDS = 3


@dataclass(frozen=True, slots=True)
class Features:
    """SIFT features of one picture.

    Parameters
    ----------
    points : (N, 2) float32
        Where they are, px.
    frames : (N,) complex64
        Size times exp(i angle): how the neighbourhood is scaled and turned.
    descriptors : (N, 128) float32
        RootSIFT, of unit length: their product is the cosine of their angle.
    """

    points: Float32Array
    frames: NDArray[np.complex64]
    descriptors: Float32Array

    def __len__(self) -> int:
        return len(self.points)


@dataclass(frozen=True, slots=True)
class Matches:
    """Points of one picture (N, 2) float32 px and the same points in another (N, 2)."""

    current: Float32Array
    other: Float32Array

    def __len__(self) -> int:
        return len(self.current)


def even_contrast(grey: ImageArray) -> ImageArray:
    """Grey picture (H, W) uint8 with its local mean and spread made equal everywhere.

    Dark plain walls hold faint texture that a detector sees only after this; the noise floor
    keeps what is merely noise from being blown up to full contrast.
    """
    values = grey.astype(np.float32)
    centred = values - cv2.GaussianBlur(values, (0, 0), _MEAN_SIGMA_PX)
    spread = np.sqrt(cv2.GaussianBlur(centred * centred, (0, 0), _SPREAD_SIGMA_PX))
    even = 128.0 + _GREY_PER_SPREAD * centred / (spread + _NOISE_GREY)
    return np.clip(even, 0.0, 255.0).astype(np.uint8)


def detect_features(grey: ImageArray) -> Features:
    """Find SIFT features of a grey picture (H, W) (Lowe 2004; RootSIFT: Arandjelovic 2012)."""
    sift = cv2.SIFT.create(
        nfeatures=_MAX_COUNT, contrastThreshold=_CONTRAST, edgeThreshold=_EDGE_RATIO
    )
    unmasked = np.full(grey.shape, 255, np.uint8)
    keypoints, raw = sift.detectAndCompute(even_contrast(grey), unmasked)
    if not keypoints:
        nothing = np.zeros((0, 2), np.float32)
        return Features(nothing, np.zeros(0, np.complex64), np.zeros((0, 128), np.float32))
    points = np.array([k.pt for k in keypoints], np.float32)
    frames = [k.size * np.exp(1j * np.radians(k.angle)) for k in keypoints]
    descriptors = np.sqrt(raw / np.maximum(raw.sum(axis=1, keepdims=True), 1e-6))
    return Features(points, np.array(frames, np.complex64), descriptors.astype(np.float32))


class FeatureMatcher:
    """Matches two sets of features, freely or near predicted places.

    The products of all descriptors are computed once for both.
    """

    def __init__(self, current: Features, other: Features, size: tuple[int, int]) -> None:
        self._current = current
        self._other = other
        self._radius_px = _AGREE_RADIUS_DIAGONALS * float(np.hypot(*size))
        self._cosine = _cosines(current.descriptors, other.descriptors)

    def match(self, ratio: float) -> Matches:
        """Mutual nearest descriptors that pass Lowe's ratio test and agree with neighbours."""
        return self._match(self._cosine, ratio)

    def match_near(self, predicted: Float32Array, within_px: float, ratio: float) -> Matches:
        """Match only what lies near the points (N, 2) px predicted for the current features.

        The ratio test then sees nearby rivals alone, so repeated texture can be matched too.
        """
        away = _as_complex(predicted)[:, None] - _as_complex(self._other.points)[None]
        near = away.real**2 + away.imag**2 < within_px**2
        return self._match(np.where(near, self._cosine, np.float32(-1.0)), ratio)

    def _match(self, cosine: Float32Array, ratio: float) -> Matches:
        if min(cosine.shape) < 2:
            nothing = np.zeros((0, 2), np.float32)
            return Matches(nothing, nothing)
        current, other = _mutual_distinct(cosine, ratio)
        kept = self._agree_with_neighbours(current, other)
        current, other = current[kept], other[kept]
        # SIFT gives a point once per orientation: keep each place once
        _, once = np.unique(np.round(self._current.points[current]), axis=0, return_index=True)
        once.sort()
        return Matches(self._current.points[current[once]], self._other.points[other[once]])

    def _agree_with_neighbours(
        self, current: NDArray[np.intp], other: NDArray[np.intp]
    ) -> BoolArray:
        """Keep matches that others nearby predict through their own scale and angle.

        Every SIFT match is a whole similarity transform, so it foretells where its neighbours
        go. Right matches support each other on any smooth surface, planar or not; wrong ones
        find nobody.
        """
        a = _as_complex(self._current.points[current])
        b = _as_complex(self._other.points[other])
        turn = self._other.frames[other] / self._current.frames[current]
        step_a, step_b = a[None, :] - a[:, None], b[None, :] - b[:, None]
        distance = np.abs(step_a)
        miss = np.abs(turn[:, None] * step_a - step_b)
        votes = (miss < _AGREE_PX + _AGREE_SHARE * distance) & (distance < self._radius_px)
        votes &= distance > 1.5
        kept = np.ones(len(a), dtype=np.bool_)
        for _ in range(_AGREE_ROUNDS):
            kept &= votes[kept].sum(axis=0) >= _AGREE_COUNT
        return kept


def _cosines(current: Float32Array, other: Float32Array) -> Float32Array:
    if not len(current) or not len(other):
        return np.zeros((len(current), len(other)), np.float32)
    return outer_product(current, other)


def _mutual_distinct(
    cosine: Float32Array, ratio: float
) -> tuple[NDArray[np.intp], NDArray[np.intp]]:
    """Indices of mutual nearest neighbours whose distance beats the second's by ``ratio``."""
    rows = np.arange(len(cosine))
    best = cosine.argmax(axis=1)
    first = cosine[rows, best]
    rivals = cosine.copy()
    rivals[rows, best] = -1.0
    # squared distance of unit vectors is 2 - 2 cos
    distinct = (1.0 - first) < ratio**2 * (1.0 - rivals.max(axis=1))
    kept = distinct & (cosine.argmax(axis=0)[best] == rows) & (first > 0.0)
    return rows[kept], best[kept]


def _as_complex(points: Float32Array) -> NDArray[np.complex64]:
    return np.ascontiguousarray(points, np.float32).view(np.complex64)[:, 0]
