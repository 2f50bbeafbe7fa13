"""Tracking: refinement of a predicted flow; and its extension by sparse matches.

1. Confident vectors of the prediction are matches; a smooth flow goes through them.
2. The dense search makes it precise.
3. The result holds if about as much of the image is confident as in the prediction. Where it does
   not, the search is repeated from its own result.

Tracking does not come back to what it has lost. An extension matches some keypoints anew, at the
turn and scale that the flow tells; those that fit one two-view geometry lead the search too.
"""

import math
from collections.abc import Callable

from dfvs_core.geometry.arrays import ImageArray
from dfvs_core.matching.config import MatchingConfig
from dfvs_core.matching.correspondence import FlowField, confident_ratio
from dfvs_core.matching.dense_search import search_residual
from dfvs_core.matching.points import PointMatches
from dfvs_core.matching.smooth_flow import confident_matches, similarity, smooth_flow
from dfvs_core.matching.verify import fit_two_views


def track(
    current: ImageArray, other: ImageArray, predicted: FlowField, config: MatchingConfig
) -> FlowField | None:
    """Flow between two grey images (H, W) by a prediction; None where it does not hold."""
    if predicted.confidence.shape != current.shape or not predicted.is_finite():
        return None
    least = max(config.least_confident_ratio, config.kept_ratio * confident_ratio(predicted))
    field = predicted
    for _ in range(1 + config.growing_rounds):
        matches = confident_matches(field)
        if len(matches) < config.least_matches:
            return None
        start = smooth_flow(matches, (current.shape[0], current.shape[1]), config)
        field = search_residual(current, other, start, config)
        if confident_ratio(field) >= least:
            return field
    return None


def extend(
    current: ImageArray,
    other: ImageArray,
    known: FlowField,
    expected: Callable[[float, float], PointMatches],
    config: MatchingConfig,
) -> FlowField | None:
    """Flow between two grey images (H, W) by a known one and by sparse matches.

    Parameters
    ----------
    known : FlowField
        Of these images, confident in a part of them.
    expected : callable
        Gives matches for the turn, rad, and the scale of ``other`` against ``current``; see
        ``PointMatcher.expected``.

    Returns
    -------
    FlowField or None
        None where too little is known, or no sparse matches fit together.
    """
    matches = confident_matches(known)
    if len(matches) < config.least_matches:
        return None
    A = similarity(matches)
    turn_rad, scale = math.atan2(A[1, 0], A[0, 0]), math.hypot(A[0, 0], A[1, 0])
    inliers = fit_two_views(expected(turn_rad, scale), config) if scale > 0.0 else None
    if inliers is None:
        return None
    size = (current.shape[0], current.shape[1])
    return search_residual(
        current, other, smooth_flow(matches.joined(inliers), size, config), config
    )
