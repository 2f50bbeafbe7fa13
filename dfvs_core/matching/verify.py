"""Verification of a match hypothesis: two-view geometry, and appearance.

A still scene moves by one fundamental matrix, so right matches lie on its epipolar lines
(MAGSAC++, Barath et al., CVPR 2020). Repeated structures do so too; but where the hypothesis is
right, nearly all that has texture and is in view of both images matches.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import cv2
import numpy as np

from dfvs_core.arrays import BoolArray, Float32Array, ImageArray
from dfvs_core.correspondence import FlowField
from dfvs_core.matching.config import MatchingConfig
from dfvs_core.matching.points import PointMatches
from dfvs_core.matching.texture import has_texture
from dfvs_core.matching.warping import lands_inside

_CONFIDENCE, _ROUNDS = 0.999, 2000
_LEAST_EXPLAINED = 0.02
"""Share of explained texture that counts as none."""
_CELL_PX = 16
"""Inliers are counted once a cell of this size: a cluster says little about the geometry."""


@dataclass(frozen=True, slots=True)
class TwoViewGeometry:
    """Inliers of a hypothesis, and the cells that they cover in either image at least."""

    inliers: PointMatches
    cells: int


def fit_two_views(matches: PointMatches, config: MatchingConfig) -> TwoViewGeometry | None:
    """Two-view geometry that explains most matches; None where there is none."""
    matches = matches.select(matches.confidence > config.least_match_confidence)
    if len(matches) < config.least_matches:
        return None
    try:
        found, mask = cv2.findFundamentalMat(
            matches.current.astype(np.float64),
            matches.other.astype(np.float64),
            cv2.USAC_MAGSAC,
            config.epipolar_px,
            _CONFIDENCE,
            _ROUNDS,
        )  # which draws the same samples every time
    except cv2.error:  # all points lead to nearly the same one, say
        return None
    if found is None:
        return None
    kept = mask.ravel() > 0
    if np.count_nonzero(kept) < config.least_matches:
        return None
    inliers = matches.select(kept)
    cells = min(_cells_covered(inliers.current), _cells_covered(inliers.other))
    return TwoViewGeometry(inliers, cells)


def probability(geometry: TwoViewGeometry, explained: float, config: MatchingConfig) -> float:
    """Probability that a hypothesis is right, by logistic regression.

    Parameters
    ----------
    geometry : TwoViewGeometry
    explained : float
        Of :func:`explained_ratio`.
    """
    constant, of_cells, of_texture = config.logit
    logit = constant + of_cells * math.log(max(geometry.cells, 1))
    logit += of_texture * math.log(explained + _LEAST_EXPLAINED)
    return 1.0 / (1.0 + math.exp(-logit))


def explained_ratio(current: ImageArray, predicted: Float32Array, field: FlowField) -> float:
    """Share of the texture in view of both images that is confidently matched.

    Parameters
    ----------
    current : (H, W)
        Grey.
    predicted : (H, W, 2)
        Flow of the hypothesis.
    field : FlowField
        Found from it.
    """
    in_both: BoolArray = has_texture(current) & lands_inside(predicted)
    if not in_both.any():
        return 0.0
    return float(np.mean(field.confidence[in_both] > 0.5))


def _cells_covered(points: Float32Array) -> int:
    return len(np.unique((points // _CELL_PX).astype(np.intp), axis=0))
