"""The feature error ||s - s*||, of the same features from frame to frame.

What is matched changes with every frame, and the median over other features is another one: it
goes up and down by percents while nothing moves. So a frame is compared with an earlier one, the
reference, in the cells of the goal picture that both show; its error is the reference's, times
what is left of it there.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from dfvs_core.arrays import FloatArray
from dfvs_core.servo.points import ServoPoints
from dfvs_core.servo.weights import weighted_median

_RENEWED_BELOW, _LEAST_COMMON = 0.5, 0.2
"""Shares of the reference's features, by weight, that are in view: below the one this frame
becomes the reference, below the other it is not even compared with the old one."""

_ROW = 2.0**24
"""More cells than there are in a row."""

_NOTHING = 1e-9
"""Length, in normalised units, of an error that is none."""


@dataclass(frozen=True, slots=True)
class CellErrors:
    """Mean feature error in each of n cells of the goal picture.

    ``cell`` (n,) names them and rises, ``error`` (n, 2) is in normalised units, ``weight`` (n,) is
    positive.
    """

    cell: FloatArray
    error: FloatArray
    weight: FloatArray


@dataclass(frozen=True, slots=True)
class Reference:
    """A frame that others are compared with, and its feature error in normalised units."""

    cells: CellErrors
    length: float


def feature_error(
    points: ServoPoints, cell_size: float, reference: Reference | None
) -> tuple[float, Reference]:
    """Weighted median length of the feature error, as it follows from a reference.

    Parameters
    ----------
    points : ServoPoints
        All that was matched.
    cell_size : float
        Width of a cell of the goal picture, normalised units.
    reference : Reference, optional
        None: the length is this frame's own, and it is the reference of those to come.

    Returns
    -------
    float
        In normalised units.
    Reference
        For the next frame: the same, as long as half of its features are in view.
    """
    cells = _by_cell(points, cell_size)
    if reference is not None and reference.length > _NOTHING:
        share, left = _compare(reference.cells, cells)
        length = left * reference.length
        if share >= _RENEWED_BELOW:
            return length, reference
        if share >= _LEAST_COMMON:
            return length, Reference(cells, length)
    length = weighted_median(np.linalg.norm(points.error, axis=1), points.weight)
    return length, Reference(cells, length)


def _by_cell(points: ServoPoints, size: float) -> CellErrors:
    """Features of the same cell of the goal picture taken for one."""
    column, row = np.floor(points.xy_goal / size).T
    cell, of_point = np.unique(row * _ROW + column, return_inverse=True)
    weight = np.asarray(np.bincount(of_point, points.weight), np.float64)
    summed = [np.bincount(of_point, points.weight * e) for e in points.error.T]
    return CellErrors(cell, np.stack(summed, axis=1) / weight[:, None], weight)


def _compare(reference: CellErrors, now: CellErrors) -> tuple[float, float]:
    """Share of the reference's features that are in view, and what is left of their error."""
    _, before, after = np.intersect1d(
        reference.cell, now.cell, assume_unique=True, return_indices=True
    )
    share = float(reference.weight[before].sum() / reference.weight.sum())
    length = np.linalg.norm(reference.error[before], axis=1)
    left = np.linalg.norm(now.error[after], axis=1) / np.maximum(length, _NOTHING)
    counts = length * np.minimum(reference.weight[before], now.weight[after])
    return share, weighted_median(left, counts)
