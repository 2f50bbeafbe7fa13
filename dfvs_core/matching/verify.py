"""Verification of a match hypothesis: two-view geometry, and appearance.

A still scene moves by one fundamental matrix, so right matches lie on its epipolar lines
(MAGSAC++, Barath et al., CVPR 2020). Repeated structures do so too; but where the hypothesis is
right, nearly all that has texture and is in view of both images matches.
"""

from __future__ import annotations

import math

import cv2
import numpy as np

from dfvs_core.arrays import BoolArray, Float32Array, ImageArray
from dfvs_core.correspondence import FlowField
from dfvs_core.matching.confidence import CONFIDENT
from dfvs_core.matching.config import MatchingConfig
from dfvs_core.matching.points import PointMatches
from dfvs_core.matching.texture import has_texture
from dfvs_core.matching.warping import lands_inside

_CONFIDENCE, _ROUNDS = 0.999, 2000
_LEAST_EXPLAINED = 0.02
"""Share of explained texture that counts as none."""
_CONFIRMED_PX = 4.0
"""Distance between a match and the dense flow within which it is confirmed."""


def fit_two_views(matches: PointMatches, config: MatchingConfig) -> PointMatches | None:
    """Inliers of the two-view geometry that explains most matches; None where there is none."""
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
    return matches.select(kept)


def probability(confirmed: float, explained: float, config: MatchingConfig) -> float:
    """Probability that a hypothesis is right, by logistic regression.

    Parameters
    ----------
    confirmed : float
        Of :func:`support`.
    explained : float
        Of :func:`explained_ratio`.
    """
    constant, of_support, of_texture = config.logit
    logit = constant + of_support * math.log(confirmed + 1.0)
    logit += of_texture * math.log(explained + _LEAST_EXPLAINED)
    return 1.0 / (1.0 + math.exp(-logit))


def support(matches: PointMatches, field: FlowField) -> float:
    """Sum of the confidence of the matches that a dense flow (H, W) confirms."""
    last = np.array(field.confidence.shape[::-1]) - 1
    u, v = np.clip(np.rint(matches.current).astype(np.intp), 0, last).T
    apart = np.linalg.norm(field.flow[v, u] - (matches.other - matches.current), axis=1)
    confirmed = (apart < _CONFIRMED_PX) & (field.confidence[v, u] > CONFIDENT)
    return float(matches.confidence[confirmed].sum())


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
    return float(np.mean(field.confidence[in_both] > CONFIDENT))
