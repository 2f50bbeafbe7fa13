"""Robust statistics: Tukey's biweight, weighted median, noise scale."""

import math
from dataclasses import dataclass

import numpy as np

from dfvs_core.geometry.arrays import FloatArray

TUKEY_CONSTANT = 4.685
"""Tukey's c for 95 % efficiency on normal noise."""


@dataclass(frozen=True, slots=True)
class NoiseScale:
    """Bounds of the standard deviation that is told from residuals, in their unit.

    ``least`` is what is expected of good ones: a perfect fit rejects nobody. ``most`` keeps a fit
    to those that are near where it begins, instead of a compromise between all.
    """

    least: float
    most: float = math.inf


def weighted_median(values: FloatArray, weights: FloatArray) -> float:
    """Median of values : (N,) where each counts by its weight; 0 when nothing counts."""
    total = float(weights.sum())
    if total <= 0.0:
        return 0.0
    order = np.argsort(values)
    cumulated = np.cumsum(weights[order])
    return float(values[order][np.searchsorted(cumulated, 0.5 * total)])


def weighted_slope(x: FloatArray, y: FloatArray, weights: FloatArray) -> FloatArray:
    """Matrix A (2, 2) of the affine map ``y = x A + b`` that fits best; x and y are (N, 2)."""
    root = np.sqrt(weights)[:, None]
    columns = np.column_stack([x, np.ones(len(x))])
    A = np.linalg.lstsq(root * columns, root * y, rcond=None)[0][:2]
    return np.asarray(A, np.float64)


def tukey_weights(residual: FloatArray, prior: FloatArray, noise: NoiseScale) -> FloatArray:
    """Tukey's biweight of residual lengths, with a robust scale.

    Parameters
    ----------
    residual : (N,) float64
        Length of each point's residual.
    prior : (N,) float64
        Weights that the points come with.
    noise : NoiseScale
        Bounds of the scale.

    Returns
    -------
    (N,) float64
        Factors from 0 to 1, to be multiplied with ``prior``.
    """
    # The residual's length is Rayleigh distributed: its median is 1.1774 sigma of one axis.
    sigma = min(max(weighted_median(residual, prior) / 1.1774, noise.least), noise.most)
    ratio = residual / (TUKEY_CONSTANT * sigma)
    inside = np.clip(1.0 - ratio * ratio, 0.0, None)
    weights: FloatArray = inside * inside
    return weights
