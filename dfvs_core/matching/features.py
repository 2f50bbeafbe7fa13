"""Sparse features: RootSIFT on a picture whose local contrast was evened out, and their matches.

Points are in OpenCV's pixel coordinates, the first pixel's centre at (0, 0).
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import cast

import cv2
import numpy as np
from numpy.typing import NDArray

from dfvs_core.arrays import BoolArray, Float32Array, ImageArray
from dfvs_core.matching.products import outer_product

_MEAN_SIGMA_PX = 12.0
_SPREAD_SIGMA_PX = 16.0
_NOISE_GREY = 1.5
_GREY_PER_SPREAD = 45.0

_WIDTH_PX = 640.0
"""Smaller pictures are enlarged to this width, but not more than twice: what is seen far off in one
of two pictures is small there, and has no features left otherwise."""
_TILES, _TILE_MARGIN_PX = 2, 24
_PER_TILE = 750
_CONTRAST = 0.015
_EDGE_RATIO = 15.0

_BLOCK_ROWS = 512

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
    """Find SIFT features of a grey picture (H, W) (Lowe 2004; RootSIFT: Arandjelovic 2012).

    Tile by tile: no corner is left without any for the many of another, and the scale space of a
    quarter of the picture takes a quarter of the memory.
    """
    scale = min(2.0, max(1.0, _WIDTH_PX / grey.shape[1]))
    even = even_contrast(grey)
    if scale > 1.0:
        even = cast(
            ImageArray, cv2.resize(even, None, fx=scale, fy=scale, interpolation=cv2.INTER_CUBIC)
        )
    tiles = [_features_of_tile(even, row, column) for row, column in np.ndindex(_TILES, _TILES)]
    points = np.concatenate([tile.points for tile in tiles])
    half = np.float32(0.5)
    return Features(
        (points + half) / np.float32(scale) - half,
        (np.concatenate([tile.frames for tile in tiles]) / scale).astype(np.complex64),
        np.concatenate([tile.descriptors for tile in tiles]),
    )


def _features_of_tile(even: ImageArray, row: int, column: int) -> Features:
    """Features whose points are in one tile of a picture, in the picture's pixels."""
    (top, bottom), (left, right) = (
        (size * k // _TILES, size * (k + 1) // _TILES)
        for size, k in zip(even.shape, (row, column), strict=True)
    )
    first_u, first_v = max(0, left - _TILE_MARGIN_PX), max(0, top - _TILE_MARGIN_PX)
    cut = even[first_v : bottom + _TILE_MARGIN_PX, first_u : right + _TILE_MARGIN_PX]
    in_tile = np.zeros(cut.shape, np.uint8)
    in_tile[top - first_v : bottom - first_v, left - first_u : right - first_u] = 255
    sift = cv2.SIFT.create(
        nfeatures=_PER_TILE, contrastThreshold=_CONTRAST, edgeThreshold=_EDGE_RATIO
    )
    keypoints, raw = sift.detectAndCompute(np.ascontiguousarray(cut), in_tile)
    points = np.array([k.pt for k in keypoints], np.float32).reshape(-1, 2)
    frames = np.array([k.size * np.exp(1j * np.radians(k.angle)) for k in keypoints], np.complex64)
    if not keypoints:
        return Features(points, frames, np.zeros((0, 128), np.float32))
    descriptors = np.sqrt(raw / np.maximum(raw.sum(axis=1, keepdims=True), 1e-6))
    return Features(
        points + np.array([first_u, first_v], np.float32), frames, descriptors.astype(np.float32)
    )


def match_features(
    current: Features, other: Features, size: tuple[int, int], ratio: float
) -> Matches:
    """Mutual nearest descriptors that pass Lowe's ratio test and agree with their neighbours.

    Parameters
    ----------
    current, other : Features
    size : (height, width)
        Of both pictures, px.
    ratio : float
        Of the distances of the nearest descriptor and the next one, at most.
    """
    if min(len(current), len(other)) < 2:
        nothing = np.zeros((0, 2), np.float32)
        return Matches(nothing, nothing)
    ours, theirs = _mutual_distinct(current.descriptors, other.descriptors, ratio)
    radius_px = _AGREE_RADIUS_DIAGONALS * float(np.hypot(*size))
    kept = _agree_with_neighbours(current, other, (ours, theirs), radius_px)
    ours, theirs = ours[kept], theirs[kept]
    # SIFT gives a point once per orientation: keep each place once
    _, once = np.unique(np.round(current.points[ours]), axis=0, return_index=True)
    once.sort()
    return Matches(current.points[ours[once]], other.points[theirs[once]])


def _agree_with_neighbours(
    current: Features,
    other: Features,
    pairs: tuple[NDArray[np.intp], NDArray[np.intp]],
    radius_px: float,
) -> BoolArray:
    """Keep matches that others nearby predict through their own scale and angle.

    Every SIFT match is a whole similarity transform, so it foretells where its neighbours
    go. Right matches support each other on any smooth surface, planar or not; wrong ones
    find nobody.
    """
    ours, theirs = pairs
    a, b = _as_complex(current.points[ours]), _as_complex(other.points[theirs])
    turn = other.frames[theirs] / current.frames[ours]
    step_a, step_b = a[None, :] - a[:, None], b[None, :] - b[:, None]
    distance = np.abs(step_a)
    miss = np.abs(turn[:, None] * step_a - step_b)
    votes = (miss < _AGREE_PX + _AGREE_SHARE * distance) & (distance < radius_px)
    votes &= distance > 1.5
    kept = np.ones(len(a), dtype=np.bool_)
    for _ in range(_AGREE_ROUNDS):
        kept &= votes[kept].sum(axis=0) >= _AGREE_COUNT
    return kept


def _mutual_distinct(
    current: Float32Array, other: Float32Array, ratio: float
) -> tuple[NDArray[np.intp], NDArray[np.intp]]:
    """Indices of mutual nearest descriptors whose distance beats the second's by ``ratio``.

    Some rows at a time: all products of 3000 by 3000 at once are 36 MB, and their copies too.
    """
    nearest = np.zeros(len(current), np.intp)
    first, second = (np.zeros(len(current), np.float32) for _ in range(2))
    nearest_of_other = np.zeros(len(other), np.intp)
    most_of_other = np.full(len(other), -1.0, np.float32)
    for start in range(0, len(current), _BLOCK_ROWS):
        block = slice(start, start + _BLOCK_ROWS)
        cosine = outer_product(current[block], other)
        rows, columns = np.arange(len(cosine)), np.arange(len(other))
        top = cosine.argmax(axis=0)
        more = cosine[top, columns] > most_of_other
        nearest_of_other[more] = start + top[more]
        most_of_other[more] = cosine[top, columns][more]
        nearest[block] = cosine.argmax(axis=1)
        first[block] = cosine[rows, nearest[block]]
        cosine[rows, nearest[block]] = -1.0
        second[block] = cosine.max(axis=1)
    # squared distance of unit vectors is 2 - 2 cos
    distinct = (1.0 - first) < ratio**2 * (1.0 - second)
    mutual = nearest_of_other[nearest] == np.arange(len(current))
    kept = np.flatnonzero(distinct & mutual & (first > 0.0))
    return kept, nearest[kept]


def _as_complex(points: Float32Array) -> NDArray[np.complex64]:
    return np.ascontiguousarray(points, np.float32).view(np.complex64)[:, 0]
