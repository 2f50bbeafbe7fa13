"""Relocalisation: a wide-baseline match without a prior.

1. The point matcher gives hypotheses: matches with the other image, upright or turned.
2. A two-view geometry is fitted; its inliers are kept.
3. A smooth flow through the inliers predicts where everything else is.
4. The dense search makes it precise, and grows from what it has confirmed.
5. The first hypothesis that is confident in enough of the image, and explains enough of the
   texture in view of both images, is the match.
"""

import itertools
from collections.abc import Iterable

from dfvs_core.geometry.arrays import ImageArray
from dfvs_core.matching.config import MatchingConfig
from dfvs_core.matching.correspondence import FlowField, confident_ratio, merge_by_confidence
from dfvs_core.matching.dense_search import search_residual
from dfvs_core.matching.points import PointMatches
from dfvs_core.matching.smooth_flow import confident_matches, smooth_flow
from dfvs_core.matching.verify import explained_ratio, fit_two_views


def relocalise(
    current: ImageArray,
    other: ImageArray,
    hypotheses: Iterable[PointMatches],
    config: MatchingConfig,
) -> FlowField | None:
    """Flow between two grey images (H, W), or None.

    Parameters
    ----------
    hypotheses : iterable of PointMatches
        In px of these images, the likeliest first; each is asked for when all before it failed.
    """
    for matches in itertools.islice(hypotheses, config.most_hypotheses):
        inliers = fit_two_views(matches, config)
        if inliers is None:
            continue
        field, explained = _densify(current, other, inliers, config)
        enough = confident_ratio(field) >= config.least_confident_ratio
        if enough and explained >= config.least_explained_ratio:
            return field
    return None


def _densify(
    current: ImageArray, other: ImageArray, inliers: PointMatches, config: MatchingConfig
) -> tuple[FlowField, float]:
    """Dense flow from the inliers of a hypothesis, and its explained ratio."""
    size = (current.shape[0], current.shape[1])
    predicted = smooth_flow(inliers, size, config)
    field = search_residual(current, other, predicted, config)
    for _ in range(config.growing_rounds):
        confirmed = confident_matches(field)
        if len(confirmed) < config.least_matches:
            break
        predicted = smooth_flow(confirmed, size, config)
        found = search_residual(current, other, predicted, config)
        field = merge_by_confidence(found, field)
    return field, explained_ratio(current, predicted, field, config)
