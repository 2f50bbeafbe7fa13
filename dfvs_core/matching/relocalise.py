"""Relocalisation: a wide-baseline match without a prior.

1. The point matcher gives hypotheses: matches with the other image, upright or turned.
2. A two-view geometry is fitted; its inliers are kept.
3. A smooth flow through the inliers predicts where everything else is.
4. The dense search makes it precise, and grows from what it has confirmed.
5. Confirmed matches, and the texture that is explained, give the hypothesis a probability.
   The next one is tried while none is clear. Below ``least_probability`` there is no match.
"""

from __future__ import annotations

import itertools
from collections.abc import Iterable
from dataclasses import dataclass

import numpy as np

from dfvs_core.arrays import Float32Array, ImageArray
from dfvs_core.correspondence import FlowField
from dfvs_core.matching.confidence import CONFIDENT, merge_by_confidence
from dfvs_core.matching.config import MatchingConfig
from dfvs_core.matching.dense_search import search_residual
from dfvs_core.matching.points import PointMatches
from dfvs_core.matching.smooth_flow import confident_matches, smooth_flow
from dfvs_core.matching.verify import (
    explained_ratio,
    fit_two_views,
    probability,
    support,
)
from dfvs_core.matching.warping import lands_inside

_PASSES_PX = 2.0
"""Distance between the smooth flow and a match within which it passes through."""
_AROUND_PX = 4
"""Half side of the surroundings of an inlier."""


@dataclass(frozen=True, slots=True)
class MatchHypothesis:
    """A flow and the probability that it is right."""

    field: FlowField
    probability: float


def relocalise(
    current: ImageArray,
    other: ImageArray,
    hypotheses: Iterable[PointMatches],
    config: MatchingConfig,
) -> MatchHypothesis | None:
    """Likeliest flow between two grey images (H, W), or None.

    Parameters
    ----------
    hypotheses : iterable of PointMatches
        In px of these images, the likeliest first; one is asked for while none before it is clear.
    """
    best: MatchHypothesis | None = None
    for matches in itertools.islice(hypotheses, config.most_hypotheses):
        inliers = fit_two_views(matches, config)
        if inliers is None:
            continue
        found = _densify(current, other, matches, inliers, config)
        if best is None or found.probability > best.probability:
            best = found
        if best.probability >= config.clear_probability:
            break
    return best if best is not None and best.probability >= config.least_probability else None


def _densify(
    current: ImageArray,
    other: ImageArray,
    matches: PointMatches,
    inliers: PointMatches,
    config: MatchingConfig,
) -> MatchHypothesis:
    """Dense flow from the inliers of a hypothesis, and its probability."""
    size = (current.shape[0], current.shape[1])
    predicted = smooth_flow(inliers, size, config)
    searched = search_residual(current, other, predicted, config)
    field = merge_by_confidence(searched, _around_inliers(predicted, inliers, searched))
    for _ in range(config.growing_rounds):
        again = confident_matches(field, config.cell_px)
        if len(again) < config.least_matches:
            break
        predicted = smooth_flow(again, size, config)
        found = search_residual(current, other, predicted, config)
        searched, field = (merge_by_confidence(found, each) for each in (searched, field))
    # inliers that the search does not confirm explain nothing
    explained = explained_ratio(current, predicted, searched)
    return MatchHypothesis(field, probability(support(matches, field), explained, config))


def _around_inliers(predicted: Float32Array, inliers: PointMatches, field: FlowField) -> FlowField:
    """The predicted flow, confident around inliers that it passes through.

    Only those count where the dense search has found nothing.
    """
    confidence = np.zeros_like(field.confidence)
    last = np.array(confidence.shape[::-1]) - 1
    u, v = np.clip(np.rint(inliers.current).astype(np.intp), 0, last).T
    miss = np.linalg.norm(predicted[v, u] - (inliers.other - inliers.current), axis=1)
    for k in np.flatnonzero((miss < _PASSES_PX) & (field.confidence[v, u] < CONFIDENT)):
        rows, columns = (slice(max(0, at - _AROUND_PX), at + _AROUND_PX + 1) for at in (v[k], u[k]))
        here = confidence[rows, columns]
        np.maximum(here, 0.5 * (1.0 + inliers.confidence[k]), out=here)
    return FlowField(predicted, confidence * lands_inside(predicted))
