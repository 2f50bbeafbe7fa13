"""Sparse features: RootSIFT on a picture whose local contrast was evened out."""

from __future__ import annotations

from dataclasses import dataclass

import cv2
import numpy as np

from dfvs_core.arrays import Float32Array, ImageArray

_MEAN_SIGMA_PX = 12.0
_SPREAD_SIGMA_PX = 16.0
_NOISE_GREY = 1.5
_GREY_PER_SPREAD = 45.0


@dataclass(frozen=True, slots=True)
class Features:
    """Points (N, 2) float32 px (OpenCV's coordinates) and descriptors (N, 128) float32.

    Descriptors have unit length, so that their product is the cosine of their angle.
    """

    points: Float32Array
    descriptors: Float32Array


@dataclass(frozen=True, slots=True)
class Matches:
    """Points of one picture (N, 2) float32 px and the same points in another (N, 2)."""

    current: Float32Array
    other: Float32Array

    def __len__(self) -> int:
        return len(self.current)


def even_contrast(image: ImageArray) -> ImageArray:
    """Grey picture (H, W) uint8 of ``image`` (H, W, 3), local mean and spread made equal.

    Dark plain walls hold faint texture that a matcher sees only after this; the noise floor
    keeps what is merely noise from being blown up to full contrast.
    """
    grey = cv2.cvtColor(image, cv2.COLOR_RGB2GRAY).astype(np.float32)
    centred = grey - cv2.GaussianBlur(grey, (0, 0), _MEAN_SIGMA_PX)
    spread = np.sqrt(cv2.GaussianBlur(centred * centred, (0, 0), _SPREAD_SIGMA_PX))
    even = 128.0 + _GREY_PER_SPREAD * centred / (spread + _NOISE_GREY)
    return np.clip(even, 0.0, 255.0).astype(np.uint8)


def detect(even: ImageArray, count: int, contrast: float = 0.015) -> Features:
    """Find the ``count`` strongest SIFT points of a grey picture (Lowe 2004; RootSIFT 2012)."""
    sift = cv2.SIFT.create(nfeatures=count, contrastThreshold=contrast, edgeThreshold=15)
    keypoints, raw = sift.detectAndCompute(even, None)
    if not keypoints:
        return Features(np.zeros((0, 2), np.float32), np.zeros((0, 128), np.float32))
    points = np.array([k.pt for k in keypoints], dtype=np.float32)
    return Features(points, np.sqrt(raw / raw.sum(axis=1, keepdims=True)).astype(np.float32))


def match_features(current: Features, other: Features, ratio: float = 0.85) -> Matches:
    """Mutual nearest neighbours that pass Lowe's ratio test on the descriptors' distance."""
    if len(current.points) < 2 or len(other.points) < 2:
        nothing = np.zeros((0, 2), np.float32)
        return Matches(nothing, nothing)
    cosine = current.descriptors @ other.descriptors.T
    best = cosine.argmax(axis=1)
    rows = np.arange(len(best))
    mutual = cosine.argmax(axis=0)[best] == rows
    first = cosine[rows, best].copy()
    cosine[rows, best] = -1.0
    second = cosine.max(axis=1)
    # squared distance of unit vectors is 2 - 2 cos
    distinct = (1.0 - first) < ratio**2 * (1.0 - second)
    kept = mutual & distinct
    return Matches(current.points[kept], other.points[best[kept]])
