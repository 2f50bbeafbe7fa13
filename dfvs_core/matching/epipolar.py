"""Plane plus parallax: how a still scene moves between two pictures of it.

Whatever its depth, a point lies on a line of the other picture. With the homography H of any
plane of the scene and the epipole e, it is seen at H x + g e (homogeneous): g is its parallax, a
number in place of a vector, zero on that plane and linear in x on any other (Hartley and
Zisserman 2003, 13.3). Neither focal length nor motion of the camera need be known.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import TypeVar

import cv2
import numpy as np

from dfvs_core.arrays import BoolArray, Float32Array, FloatArray
from dfvs_core.correspondence import FlowField
from dfvs_core.matching.warping import pixel_grid

Points = TypeVar("Points", Float32Array, FloatArray)

_STRIDE_PX = 6
_SURE = 0.5
_FEWEST = 40
_KEPT_SHARE = 0.9
"""Share of the sure points that has to agree on lines; chance matches agree less."""
_MISS_PX = 1.0
_CERTAINTY, _ROUNDS = 0.999, 2000
_PLANE_ROUNDS = 6
_PLANE_SCALE = 0.125
"""Distance from the plane's image, in half widths, at which a point counts a quarter."""
_LEAST_DEPTH = 0.05


@dataclass(frozen=True, slots=True)
class Parallax:
    """Parallax (N,) of points whose flow is known.

    ``miss_px`` (N,) is how far the flow leads from the point's line, ``px`` (N,) how far the
    place in the other picture moves per unit of parallax.
    """

    value: FloatArray
    miss_px: FloatArray
    px: FloatArray


@dataclass(frozen=True, slots=True)
class EpipolarGeometry:
    """Where the points of a picture may be in another one, both of ``size`` (height, width).

    ``homography`` (3, 3) and ``epipole`` (3,) act on half widths from the picture's middle;
    about 1 is the third coordinate of what both pictures see.
    """

    size: tuple[int, int]
    homography: FloatArray
    epipole: FloatArray

    def on_plane(self, at: Float32Array) -> Float32Array:
        """Homogeneous places (..., 3) in the other picture of points (..., 2) px of the plane."""
        return _homogeneous(at, self.size) @ self.homography.T.astype(np.float32)

    def places(
        self, on_plane: Float32Array, parallax: Float32Array | float
    ) -> tuple[Float32Array, BoolArray]:
        """Places (..., 2) px in the other picture, and whether they are in front of the camera.

        ``parallax`` (...) or a number is added to what ``on_plane`` (..., 3) gives.
        """
        x, y, depth = (on_plane[..., k] + np.float32(self.epipole[k]) * parallax for k in range(3))
        in_front = depth > _LEAST_DEPTH
        per_depth = np.float32(_half_width(self.size)) / np.where(in_front, depth, 1.0)
        u, v = _middle(self.size).astype(np.float32)
        return np.stack([x * per_depth + u, y * per_depth + v], axis=-1), in_front

    def parallax(self, at: FloatArray, to: FloatArray) -> Parallax:
        """Parallax with which points (N, 2) px come nearest to ``to`` (N, 2) px."""
        seen = _homogeneous(at, self.size) @ self.homography.T
        goal = _homogeneous(to, self.size)[:, :2]
        off = goal * seen[:, 2:] - seen[:, :2]
        along = self.epipole[:2] - goal * self.epipole[2]
        square = np.einsum("nk,nk->n", along, along)
        value = np.einsum("nk,nk->n", off, along) / (square + 1e-12)
        depth = np.maximum(np.abs(seen[:, 2] + value * self.epipole[2]), _LEAST_DEPTH)
        scale = _half_width(self.size) / depth
        miss = np.linalg.norm(off - value[:, None] * along, axis=1)
        return Parallax(value, miss * scale, np.sqrt(square) * scale)

    def flow(self, parallax: Float32Array) -> Float32Array:
        """Flow (H, W, 2) px of points of this parallax (H, W)."""
        at = pixel_grid(self.size)
        to, in_front = self.places(self.on_plane(at), parallax)
        return np.where(in_front[..., None], to - at, np.float32(0.0))


def fit_epipolar(field: FlowField) -> EpipolarGeometry | None:
    """Epipolar geometry of a flow, from what is sure of it; None where that does not agree."""
    size = field.confidence.shape[:2]
    at, to = sure_points(field, _STRIDE_PX)
    if len(at) < _FEWEST:
        return None
    try:
        found, mask = cv2.findFundamentalMat(
            at, to, cv2.USAC_MAGSAC, _MISS_PX, _CERTAINTY, _ROUNDS
        )  # which draws the same samples every time
    except cv2.error:  # it found no lines at all: all points lead to nearly the same one, say
        return None
    if found is None or found.shape != (3, 3):
        return None
    kept = mask.ravel() > 0
    if kept.mean() < _KEPT_SHARE:
        return None
    return _about_plane(np.asarray(found, np.float64), at[kept], to[kept], size)


def sure_points(field: FlowField, stride: int) -> tuple[FloatArray, FloatArray]:
    """Points (N, 2) px on a regular grid whose flow is sure, and where it leads (N, 2) px."""
    grid = (slice(stride // 2, None, stride),) * 2
    sure = field.confidence[grid] > _SURE
    at = pixel_grid(field.confidence.shape[:2])[grid][sure].astype(np.float64)
    return at, at + field.flow[grid][sure]


def _about_plane(
    fundamental: FloatArray, at: FloatArray, to: FloatArray, size: tuple[int, int]
) -> EpipolarGeometry:
    """Choose, of all planes' homographies, that of the plane most points (N, 2) px are on.

    They are [e]x F + e a^T, a being the plane; cross products with where the points lead are
    linear in it. Reweighted least squares.
    """
    half, middle = _half_width(size), _middle(size)
    to_px = np.array([[half, 0.0, middle[0]], [0.0, half, middle[1]], [0.0, 0.0, 1.0]])
    unit = to_px.T @ fundamental @ to_px
    epipole = np.linalg.svd(unit.T)[2][2]
    first = np.cross(np.eye(3), epipole) @ unit
    x, y = _homogeneous(at, size), _homogeneous(to, size)
    rest = np.cross(y, x @ first.T)
    slope = np.cross(y, epipole)[:, :, None] * x[:, None, :]  # (N, 3, 3)
    weight: FloatArray = np.ones(len(x))
    homography = first
    for _ in range(_PLANE_ROUNDS):
        weighted = slope * weight[:, None, None]
        normal = np.einsum("nki,nkj->ij", weighted, slope) + 1e-9 * np.eye(3)
        plane = np.linalg.solve(normal, -np.einsum("nki,nk->i", weighted, rest))
        homography = first + np.outer(epipole, plane)
        seen = x @ homography.T
        off = np.linalg.norm(seen[:, :2] / _away_from_zero(seen[:, 2:]) - y[:, :2], axis=1)
        weight = 1.0 / (1.0 + (off / _PLANE_SCALE) ** 2) ** 2
    depth = float(np.median((x @ homography.T)[:, 2]))
    return EpipolarGeometry(size, homography / (depth or 1.0), epipole)


def _away_from_zero(values: FloatArray) -> FloatArray:
    return np.where(np.abs(values) < 1e-6, 1e-6, values)


def _half_width(size: tuple[int, int]) -> float:
    return 0.5 * size[1]


def _middle(size: tuple[int, int]) -> FloatArray:
    return np.array([0.5 * (size[1] - 1), 0.5 * (size[0] - 1)])


def _homogeneous(points: Points, size: tuple[int, int]) -> Points:
    """Points (..., 3) in half widths from the middle."""
    unit = (points - _middle(size).astype(points.dtype)) / points.dtype.type(_half_width(size))
    return np.concatenate([unit, np.ones_like(unit[..., :1])], axis=-1)
