"""Smooth interpolation of scattered matches to a flow field.

A similarity of least median of squares is fitted first. What it leaves is interpolated on a grid
of cells by affine normalised convolution (Knutsson and Westin, CVPR 1993), octave by octave from
the width of the image to a cell. Planes are extended as planes, and where there are no matches the
wider motion stays.
"""

import functools
from typing import cast

import cv2
import numpy as np

from dfvs_core.geometry.arrays import Float32Array, FloatArray
from dfvs_core.matching.config import PATCH_PX, MatchingConfig
from dfvs_core.matching.correspondence import CONFIDENT, FlowField
from dfvs_core.matching.points import PointMatches
from dfvs_core.matching.warping import pixel_grid, sample


def smooth_flow(
    matches: PointMatches, size: tuple[int, int], config: MatchingConfig
) -> Float32Array:
    """Flow (H, W, 2) px of an image of ``size`` (height, width) through one match or more."""
    A = similarity(matches)
    height, width = size
    cells = -(-height // PATCH_PX), -(-width // PATCH_PX)
    at = ((matches.current + 0.5) / PATCH_PX - 0.5).astype(np.float32)
    rest = (matches.other - matches.current @ A[:, :2].T - A[:, 2]).astype(np.float32)
    rest /= PATCH_PX
    residual = config.residual_sigmas * config.noise_px / PATCH_PX
    bend: Float32Array = np.zeros((*cells, 2), np.float32)
    for sigma in 2.0 ** np.arange(int(np.log2(cells[1])), -1, -1):
        miss = np.linalg.norm(rest, axis=1) / (residual * (1.0 + np.sqrt(sigma)))
        weight = matches.confidence / (1.0 + miss**2) ** 2  # Geman and McClure
        level = _interpolate(
            PointMatches(at, at + rest, weight.astype(np.float32)), cells, sigma, config.damping
        )
        bend += level
        rest -= sample(level, at[:, None])[:, 0]
    whole = (cells[1] * PATCH_PX, cells[0] * PATCH_PX)
    bend = cast(Float32Array, cv2.resize(bend, whole, interpolation=cv2.INTER_LINEAR))
    linear = cv2.transform(pixel_grid(size), (A - np.eye(2, 3)).astype(np.float32))
    return np.asarray(linear + PATCH_PX * bend[:height, :width], np.float32)


def similarity(matches: PointMatches) -> FloatArray:
    """Similarity (2, 3) of least median of squares from one image to the other, px."""
    found, _ = cv2.estimateAffinePartial2D(
        matches.current.astype(np.float64), matches.other.astype(np.float64), method=cv2.LMEDS
    )
    return np.eye(2, 3) if found is None else np.asarray(found, np.float64)


def confident_matches(field: FlowField) -> PointMatches:
    """Matches of a flow, one a patch, where it has some confidence."""
    grid = (slice(PATCH_PX // 2, None, PATCH_PX),) * 2
    kept = field.confidence[grid] >= CONFIDENT
    points = pixel_grid(field.confidence.shape[:2])[grid][kept]
    return PointMatches(points, points + field.flow[grid][kept], field.confidence[grid][kept])


def _interpolate(
    rest: PointMatches, cells: tuple[int, int], sigma: float, damping: float
) -> Float32Array:
    """Displacements (h, w, 2) at the cells of a grid, of matches in cells.

    Each cell fits an affine function to the displacements around it, under Gaussian weights of
    ``sigma`` cells; ``damping`` draws its offset and its slope to zero.
    """
    design = np.vstack([np.ones(len(rest)), rest.current.T])
    terms = design[:, None] * np.vstack([design, (rest.other - rest.current).T]) * rest.confidence
    cell_index = np.ravel_multi_index(rest.pixels(cells), cells)
    sums = [np.bincount(cell_index, term, cells[0] * cells[1]) for term in terms.reshape(15, -1)]
    rows, columns = _gaussian(cells[0], sigma), _gaussian(cells[1], sigma)
    moments = (rows @ np.reshape(sums, (15, *cells)) @ columns).reshape(3, 5, *cells)
    cell = np.concatenate([np.ones((1, *cells)), np.moveaxis(pixel_grid(cells), -1, 0)])
    normal = moments[:, :3] + damping * cell[:, None] * cell
    normal[[1, 2], [1, 2]] += damping * sigma * sigma
    # Cramer's rule: a solver of many small systems takes several times as long.
    adjugate = [np.cross(normal[i - 2], normal[i - 1], axis=0) for i in range(3)]
    weights = [(row * cell).sum(axis=0) for row in adjugate]
    fitted = sum(weight * side for weight, side in zip(weights, moments[:, 3:], strict=True))
    determinant = (normal[0] * adjugate[0]).sum(axis=0)
    return np.asarray(np.moveaxis(fitted / determinant, 0, -1), np.float32)


@functools.lru_cache(maxsize=32)
def _gaussian(count: int, sigma: float) -> FloatArray:
    """Weights (count, count) of the cells of a row for each other, 1 for themselves."""
    apart = np.subtract.outer(np.arange(count), np.arange(count)) / sigma
    return np.asarray(np.exp(-0.5 * apart * apart), np.float64)
