"""Feature error ||s - s*|| of the same features from frame to frame.

What is matched changes with every frame, and the median over other features is another one: it
goes up and down by percents while nothing moves. So a frame is compared with an earlier one, the
reference, in the cells of the goal image that both show; its error is the reference's, times
what is left of it there. Cells are as wide as two of the reference's samples are apart, so that the
samples of another frame fall into the same cells from twice as far away.
"""

from dataclasses import dataclass

import numpy as np

from dfvs_core.geometry.arrays import FloatArray
from dfvs_core.geometry.robust_weights import weighted_median, weighted_slope
from dfvs_core.servo.points import ServoPoints

_RENEWED_BELOW, _LEAST_COMMON = 0.5, 0.2
"""Shares of the reference's features, by weight, that are in view: below the one this frame
becomes the reference, below the other it is not even compared with the old one."""

_SAMPLES_WIDE = 2.0
_SCALES = 0.25, 4.0
"""Width of a cell in samples of the current view, and bounds of how much larger or smaller these
are in the goal image."""

_ROW = 2.0**24
"""More cells than there are in a row."""

_LEAST_LENGTH = 1e-9
"""Length, in normalised units, of an error that is none."""


@dataclass(frozen=True, slots=True)
class CellErrors:
    """What is seen of each of n cells of the goal image, in the mean of its features.

    ``size`` is a cell's width, ``cell`` (n,) names them and rises. ``error`` (n, 2) is in
    normalised units, ``weight`` (n,) is positive.
    """

    size: float
    cell: FloatArray
    error: FloatArray
    weight: FloatArray


@dataclass(frozen=True, slots=True)
class Reference:
    """A frame that others are compared with, and its feature error in normalised units."""

    cells: CellErrors
    length: float


def feature_error(
    points: ServoPoints, spacing: float, reference: Reference | None
) -> tuple[float, Reference]:
    """Weighted median length of the feature error, as it follows from a reference.

    Parameters
    ----------
    points : ServoPoints
        All that was matched.
    spacing : float
        From one sample of the current view to the next, normalised units.
    reference : Reference, optional
        None: the length is this frame's own, and it is the reference of those to come.

    Returns
    -------
    float
        In normalised units.
    Reference
        For the next frame: the same, as long as half of its features are in view.
    """
    if reference is not None and reference.length > _LEAST_LENGTH:
        share, left = _compare(reference.cells, by_cell(points, reference.cells.size))
        length = left * reference.length
        if share >= _RENEWED_BELOW:
            return length, reference
        if share >= _LEAST_COMMON:
            return length, _begin(points, spacing, length)
    length = weighted_median(np.linalg.norm(points.error, axis=1), points.weight)
    return length, _begin(points, spacing, length)


def by_cell(points: ServoPoints, size: float) -> CellErrors:
    """Features of the same cell of the goal image taken for one.

    ``size`` is a cell's width, in normalised units.
    """
    points = points.select(points.weight > 0.0)
    column, row = np.floor(points.xy_goal / size).T
    cell, of_point = np.unique(row * _ROW + column, return_inverse=True)
    weight = np.asarray(np.bincount(of_point, points.weight), np.float64)
    sums = [np.bincount(of_point, points.weight * component) for component in points.error.T]
    return CellErrors(size, cell, np.stack(sums, axis=1) / weight[:, None], weight)


def _begin(points: ServoPoints, spacing: float, length: float) -> Reference:
    return Reference(by_cell(points, _fitting_size(points, spacing)), length)


def _fitting_size(points: ServoPoints, spacing: float) -> float:
    """Width of a cell that holds a few samples, as wide apart as the goal image shows them."""
    area = np.linalg.det(weighted_slope(points.xy, points.xy_goal, points.weight))
    scale = np.clip(np.sqrt(abs(area)), *_SCALES)
    return float(_SAMPLES_WIDE * spacing * scale)


def _compare(reference: CellErrors, now: CellErrors) -> tuple[float, float]:
    """Share of the reference's features that are in view, and what is left of their error."""
    _, before, after = np.intersect1d(
        reference.cell, now.cell, assume_unique=True, return_indices=True
    )
    share = float(reference.weight[before].sum() / reference.weight.sum())
    length = np.linalg.norm(reference.error[before], axis=1)
    left = np.linalg.norm(now.error[after], axis=1) / np.maximum(length, _LEAST_LENGTH)
    counts = length * np.minimum(reference.weight[before], now.weight[after])
    return share, weighted_median(left, counts)
