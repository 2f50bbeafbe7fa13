"""A smooth flow through scattered matches.

A robust affine motion is fitted first. What it leaves is interpolated on a grid of cells by affine
normalised convolution (Knutsson and Westin, CVPR 1993), from wide windows to narrow ones. Planes
are extended as planes, and where there are no matches the wider motion stays.
"""

from __future__ import annotations

from typing import NamedTuple

import cv2
import numpy as np

from dfvs_core.arrays import Float32Array, FloatArray
from dfvs_core.correspondence import FlowField
from dfvs_core.matching.config import MatchingConfig
from dfvs_core.matching.points import PointMatches
from dfvs_core.matching.warping import pixel_grid

_USABLE = 0.3
"""Confidence from which on a flow vector is a match."""
_AFFINE_ROUNDS = 6
_FIRST_SCALE_PX = 40.0
"""Scale of the robust weight in the first round; it halves from round to round."""
_PRIOR_PX = 2.0
"""Noise of a match against which the prior on stretch and shear is weighed."""
_STRETCH = 0.3
"""Standard deviation of unequal stretch and of shear."""
_IDENTITY = np.array([1.0, 0.0, 0.0, 0.0, 1.0, 0.0])


def smooth_flow(
    matches: PointMatches, size: tuple[int, int], config: MatchingConfig
) -> Float32Array:
    """Flow (H, W, 2) px of an image of ``size`` (height, width) through one match or more."""
    A = _fit_affine(matches, size, config.residual_px)
    height, width = size
    cells = -(-height // config.cell_px), -(-width // config.cell_px)
    at = ((matches.current + 0.5) / config.cell_px - 0.5).astype(np.float32)
    rest = (matches.other - _apply(A, matches.current)).astype(np.float32)
    bend: Float32Array = np.zeros((*cells, 2), np.float32)
    for sigma in config.sigmas_cells:
        scale_px = config.residual_px * (1.0 + np.sqrt(sigma))
        weight = matches.confidence * _robust(np.linalg.norm(rest, axis=1), scale_px)
        damping = config.damping, config.slope_damping * sigma * sigma
        level = _interpolate(_Scattered(at, rest, weight), cells, sigma, damping)
        bend += level
        moved = cv2.remap(
            level, at[:, 0], at[:, 1], cv2.INTER_LINEAR, borderMode=cv2.BORDER_REPLICATE
        )
        rest -= moved.reshape(-1, 2)
    whole = (cells[1] * config.cell_px, cells[0] * config.cell_px)
    bend = np.asarray(cv2.resize(bend, whole, interpolation=cv2.INTER_LINEAR), np.float32)
    grid = pixel_grid(size)
    linear = grid @ (A[:, :2] - np.eye(2)).T.astype(np.float32) + A[:, 2].astype(np.float32)
    return np.asarray(linear + bend[:height, :width], np.float32)


def confident_matches(field: FlowField, stride_px: int) -> PointMatches:
    """Matches of a flow on a regular grid, where it has some confidence."""
    grid = (slice(stride_px // 2, None, stride_px),) * 2
    kept = field.confidence[grid] > _USABLE
    points = pixel_grid(field.confidence.shape[:2])[grid][kept]
    return PointMatches(points, points + field.flow[grid][kept], field.confidence[grid][kept])


class _Scattered(NamedTuple):
    """Values (N, 2) at places (N, 2) in cells, and their weights (N,)."""

    at: Float32Array
    values: Float32Array
    weight: FloatArray


def _interpolate(
    known: _Scattered, cells: tuple[int, int], sigma: float, damping: tuple[float, float]
) -> Float32Array:
    """Values (h, w, 2) at the cells of a grid.

    Each cell fits an affine function to what is known around it, under Gaussian weights of
    ``sigma`` cells; ``damping`` draws its offset and its slope to zero.
    """
    x, y = known.at.T
    one = np.ones_like(x)
    outer = np.stack([one, x, y, x * x, x * y, y * y], axis=1)
    right = (np.stack([one, x, y], axis=1)[:, :, None] * known.values[:, None, :]).reshape(-1, 6)
    sums: FloatArray = np.zeros((*cells, 12))
    row = np.clip(np.rint(y).astype(np.intp), 0, cells[0] - 1)
    column = np.clip(np.rint(x).astype(np.intp), 0, cells[1] - 1)
    np.add.at(sums, (row, column), np.column_stack([outer, right]) * known.weight[:, None])
    blurred = [
        cv2.GaussianBlur(sums[..., k : k + 4], (0, 0), sigma, borderType=cv2.BORDER_CONSTANT)
        for k in (0, 4, 8)
    ]
    sums = np.dstack(blurred).astype(np.float64) * (2.0 * np.pi * sigma * sigma)
    v, u = np.mgrid[: cells[0], : cells[1]].astype(np.float64)
    # moments about each cell's own centre
    s, sx, sy, sxx, sxy, syy = np.moveaxis(sums[..., :6], -1, 0)
    mx, my = sx - u * s, sy - v * s
    mxx, mxy, myy = sxx - u * (sx + mx), sxy - u * sy - v * mx, syy - v * (sy + my)
    offset, slope = damping
    normal = np.stack(
        [s + offset, mx, my, mx, mxx + slope, mxy, my, mxy, myy + slope], axis=-1
    ).reshape(*cells, 3, 3)
    b = sums[..., 6:].reshape(*cells, 3, 2)
    b[..., 1, :] -= u[..., None] * b[..., 0, :]
    b[..., 2, :] -= v[..., None] * b[..., 0, :]
    return np.asarray(np.linalg.solve(normal, b)[..., 0, :], np.float32)


def _fit_affine(matches: PointMatches, size: tuple[int, int], scale_px: float) -> FloatArray:
    """Affine map (2, 3) px by reweighted least squares; few matches give a similarity."""
    height, width = size
    unit = 0.25 * float(np.hypot(height, width))
    middle = 0.5 * np.array([width, height])
    x, y = ((matches.current - middle) / unit).T
    u, v = ((matches.other - middle) / unit).T
    one, nil = np.ones_like(x), np.zeros_like(x)
    rows_u = np.stack([x, y, one, nil, nil, nil], axis=1)
    rows_v = np.stack([nil, nil, nil, x, y, one], axis=1)
    stretch = np.array([[1.0, 0.0, 0.0, 0.0, -1.0, 0.0], [0.0, 1.0, 0.0, 1.0, 0.0, 0.0]])
    prior = (_PRIOR_PX / unit / _STRETCH) ** 2 * stretch.T @ stretch
    prior += np.diag([1e-6, 1e-6, 1e-9] * 2)
    weight = np.asarray(matches.confidence, np.float64)
    a = _IDENTITY
    for k in range(_AFFINE_ROUNDS):
        w = weight[:, None]
        normal = (rows_u * w).T @ rows_u + (rows_v * w).T @ rows_v + prior
        right = (rows_u * w).T @ u + (rows_v * w).T @ v + prior @ _IDENTITY
        a = np.linalg.solve(normal, right)
        miss_px = unit * np.hypot(rows_u @ a - u, rows_v @ a - v)
        weight = matches.confidence * _robust(miss_px, max(scale_px, _FIRST_SCALE_PX * 0.5**k))
    linear = a.reshape(2, 3)
    shift = middle + unit * linear[:, 2] - linear[:, :2] @ middle
    return np.column_stack([linear[:, :2], shift])


def _apply(A: FloatArray, points: Float32Array) -> FloatArray:
    return points @ A[:, :2].T + A[:, 2]


def _robust(miss: FloatArray, scale: float) -> FloatArray:
    """Weight of Geman and McClure's estimator."""
    return np.asarray(1.0 / (1.0 + (miss / scale) ** 2) ** 2)
