"""A smooth map of the image plane fitted to point matches: a homography and a bending spline.

The homography carries what a turning camera or a plane does; the cubic B-spline on top of it
(a free-form deformation with the second-difference penalty of P-splines, Eilers and Marx 1996)
carries parallax where matches ask for it, and nothing where there are none.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import lru_cache

import cv2
import numpy as np

from dfvs_core.arrays import Float32Array, FloatArray
from dfvs_core.correspondence import FlowField
from dfvs_core.matching.features import Matches
from dfvs_core.matching.products import inner_product, outer_product, product
from dfvs_core.matching.warping import homography_flow, pixel_grid

_CELLS = (8, 6)
_BENDING = 0.06
_SPLINE_ROUNDS = 4
_SPLINE_SCALE_PX = 4.0
_BLOCK_ROWS = 1024
"""Matches taken up at once: whole, the matrices are 8 MB each, which no processor's cache has room
for, nor any hole in a heap, so that its end moves."""

_HOMOGRAPHY_ROUNDS = 8
_HOMOGRAPHY_SCALE_PX = 6.0
_FIRST_SCALE_PX = 40.0
_NOISE_PX = 2.0
_PERSPECTIVE_PER_UNIT = 0.15
_STRETCH = 0.3
_SAMPLE_STRIDE_PX, _SAMPLE_CONFIDENCE = 16, 0.3
_FEWEST_SAMPLES = 12
_IDENTITY = np.array([1.0, 0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0])


@dataclass(frozen=True, slots=True)
class SmoothMotion:
    """Where the points of an image of ``size`` (height, width) go.

    ``homography`` (3, 3) acts in OpenCV's pixels; ``nodes`` (M, 2) px are the spline's.
    """

    size: tuple[int, int]
    homography: FloatArray
    nodes: FloatArray

    def at(self, points: Float32Array) -> Float32Array:
        """Where the points (N, 2) px go, (N, 2) px."""
        moved = _apply(self.homography, points) + _basis_at(points, self.size) @ self.nodes
        return moved.astype(np.float32)

    def flow(self) -> Float32Array:
        """Flow (H, W, 2) px at every pixel."""
        along_u, along_v = _basis_axes(self.size)
        nodes = self.nodes.reshape(along_v.shape[1], along_u.shape[1], 2)
        rows = [product(along_v, np.ascontiguousarray(nodes[..., k])) for k in (0, 1)]
        bend = cv2.merge([outer_product(row, along_u) for row in rows])
        return homography_flow(self.homography, self.size) + bend.astype(np.float32)


def motion_of(field: FlowField) -> SmoothMotion | None:
    """Smooth motion fitted to what is trusted of a flow; None if that is little."""
    samples = _sample_flow(field)
    if len(samples) < _FEWEST_SAMPLES:
        return None
    height, width = field.confidence.shape
    return fit_motion(samples, (height, width))


def _sample_flow(field: FlowField) -> Matches:
    """Take the trusted vectors of a flow, a few hundred on a regular grid, as matches."""
    grid = (slice(_SAMPLE_STRIDE_PX // 2, None, _SAMPLE_STRIDE_PX),) * 2
    trusted = field.confidence[grid] > _SAMPLE_CONFIDENCE
    points = pixel_grid(field.confidence.shape[:2])[grid][trusted]
    return Matches(points, points + field.flow[grid][trusted])


def fit_motion(matches: Matches, size: tuple[int, int]) -> SmoothMotion:
    """Fit a smooth motion to matches, gross errors weighed down (Geman-McClure).

    Iteratively reweighted least squares from a wide scale to a narrow one: no random sampling,
    so the same matches give the same motion. Needs one match or more; few matches give a
    similarity, one alone a shift.
    """
    homography = _fit_homography(matches, size)
    rest = matches.other - _apply(homography, matches.current)
    rows = [slice(k, k + _BLOCK_ROWS) for k in range(0, len(matches), _BLOCK_ROWS)]
    bases = [_basis_at(matches.current[block], size) for block in rows]
    weight: FloatArray = np.ones(len(matches))
    nodes = np.zeros((bases[0].shape[1], 2), np.float64)
    for _ in range(_SPLINE_ROUNDS):
        normal, right = _bending_penalty(), np.zeros_like(nodes)
        for block, basis in zip(rows, bases, strict=True):
            weighted = basis * weight[block, None]
            normal = normal + inner_product(weighted, basis)
            right = right + inner_product(weighted, rest[block])
        nodes = np.asarray(np.linalg.solve(normal, right), np.float64)
        miss = np.concatenate([basis @ nodes for basis in bases]) - rest
        weight = _robust_weight(np.linalg.norm(miss, axis=1), _SPLINE_SCALE_PX)
    return SmoothMotion(size, homography, nodes)


def _fit_homography(matches: Matches, size: tuple[int, int]) -> FloatArray:
    """Homography (3, 3) px that maps ``matches.current`` to ``matches.other``.

    The direct linear equations, reweighted, with a prior that keeps what the matches do not
    determine (perspective, unequal stretching) small instead of wild.
    """
    height, width = size
    unit = 0.25 * float(np.hypot(height, width))
    to_unit = np.array(
        [
            [1 / unit, 0, -0.5 * width / unit],
            [0, 1 / unit, -0.5 * height / unit],
            [0, 0, 1],
        ]
    )
    x, y = _apply(to_unit, matches.current).T
    u, v = _apply(to_unit, matches.other).T
    one, nil = np.ones_like(x), np.zeros_like(x)
    rows_u = np.stack([x, y, one, nil, nil, nil, -u * x, -u * y], axis=1)
    rows_v = np.stack([nil, nil, nil, x, y, one, -v * x, -v * y], axis=1)
    prior = _homography_prior(unit)
    pull = prior @ _IDENTITY
    weight: FloatArray = one
    H: FloatArray = np.eye(3)
    for k in range(_HOMOGRAPHY_ROUNDS):
        depth = np.maximum(H[2, 0] * x + H[2, 1] * y + 1.0, 0.2)
        w = (weight / depth**2)[:, None]
        normal = (rows_u * w).T @ rows_u + (rows_v * w).T @ rows_v + prior
        h = np.linalg.solve(normal, (rows_u * w).T @ u + (rows_v * w).T @ v + pull)
        H = np.append(h, 1.0).reshape(3, 3)
        depth = np.maximum(H[2, 0] * x + H[2, 1] * y + 1.0, 0.2)
        miss_px = unit * np.hypot(rows_u @ h - u, rows_v @ h - v) / depth
        scale_px = max(_HOMOGRAPHY_SCALE_PX, _FIRST_SCALE_PX * 0.5**k)
        weight = _robust_weight(miss_px, scale_px)
    return np.asarray(np.linalg.inv(to_unit) @ H @ to_unit)


def _homography_prior(unit: float) -> FloatArray:
    """Normal matrix (8, 8) of the pull of a homography's entries to the identity's.

    Entries are in units of ``unit`` px. The pull on scale and angle is next to nothing, that on
    the shift nearer still.
    """
    noise = _NOISE_PX / unit
    prior = 1e-6 * np.eye(8)
    prior[2, 2] = prior[5, 5] = 1e-9
    prior[6, 6] = prior[7, 7] = (noise / _PERSPECTIVE_PER_UNIT) ** 2
    stretch = np.zeros((2, 8))
    stretch[0, [0, 4]] = 1.0, -1.0
    stretch[1, [1, 3]] = 1.0, 1.0
    return prior + (noise / _STRETCH) ** 2 * stretch.T @ stretch


def _robust_weight(miss: FloatArray, scale: float) -> FloatArray:
    """Weight of Geman and McClure's estimator."""
    return np.asarray(1.0 / (1.0 + (miss / scale) ** 2) ** 2)


def _apply(H: FloatArray, points: Float32Array | FloatArray) -> FloatArray:
    moved = cv2.perspectiveTransform(points.reshape(-1, 1, 2).astype(np.float64), H)
    return np.asarray(moved, dtype=np.float64).reshape(-1, 2)


def _basis(x: FloatArray, cells: int) -> FloatArray:
    """Cubic B-splines (N, cells + 3) at x (N,), which is in cells from the image's border."""
    cell = np.clip(np.floor(x).astype(np.intp), 0, cells - 1)
    t = x - cell
    values = np.stack(
        [(1 - t) ** 3, 3 * t**3 - 6 * t**2 + 4, -3 * t**3 + 3 * t**2 + 3 * t + 1, t**3], axis=1
    )
    out = np.zeros((len(x), cells + 3))
    out[np.arange(len(x))[:, None], cell[:, None] + np.arange(4)] = values / 6.0
    return out


def _basis_at(points: Float32Array, size: tuple[int, int]) -> FloatArray:
    """Products of B-splines (N, M) at points (N, 2) px."""
    height, width = size
    along_u = _basis((points[:, 0] + 0.5) / width * _CELLS[0], _CELLS[0])
    along_v = _basis((points[:, 1] + 0.5) / height * _CELLS[1], _CELLS[1])
    return np.asarray((along_v[:, :, None] * along_u[:, None, :]).reshape(len(points), -1))


@lru_cache(maxsize=4)
def _basis_axes(size: tuple[int, int]) -> tuple[FloatArray, FloatArray]:
    """B-splines at the pixels' centres along u (W, .) and along v (H, .)."""
    height, width = size
    along_u = _basis((np.arange(width) + 0.5) / width * _CELLS[0], _CELLS[0])
    along_v = _basis((np.arange(height) + 0.5) / height * _CELLS[1], _CELLS[1])
    return along_u, along_v


@lru_cache(maxsize=1)
def _bending_penalty() -> FloatArray:
    """Normal matrix (M, M) of the second differences of the nodes (a thin plate's energy)."""
    eye_u, eye_v = np.eye(_CELLS[0] + 3), np.eye(_CELLS[1] + 3)
    rows = [
        np.kron(eye_v, np.diff(eye_u, 2, axis=0)),
        np.kron(np.diff(eye_v, 2, axis=0), eye_u),
        np.sqrt(2.0) * np.kron(np.diff(eye_v, axis=0), np.diff(eye_u, axis=0)),
    ]
    penalty = sum((r.T @ r for r in rows), start=np.zeros((len(eye_u) * len(eye_v),) * 2))
    return _BENDING * penalty + 1e-8 * np.eye(len(penalty))
