"""Tracking: refinement of a predicted flow.

1. Confident vectors of the prediction are matches; a smooth flow goes through them.
2. The dense search makes it precise.
3. The result holds if about as much of the image is confident as in the prediction. Where it does
   not, the search is repeated from its own result.
"""

from __future__ import annotations

from dfvs_core.geometry.arrays import ImageArray
from dfvs_core.matching.config import MatchingConfig
from dfvs_core.matching.correspondence import FlowField, confident_ratio
from dfvs_core.matching.dense_search import search_residual
from dfvs_core.matching.smooth_flow import confident_matches, smooth_flow


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
