"""Accuracy of a matching network on pairs with exact flow."""

from collections.abc import Mapping

import numpy as np

from dfvs_core.errors import ModelError
from dfvs_core.matching.matcher import Matcher
from dfvs_models.evaluation import FlowScores, LevelScore
from dfvs_models.evaluation_file import FlowPairs

MOST_ERROR_RATIO = 1.15
"""Mean error of a bundle of lower precision over that of the one it was made from."""


def error_ratios(
    scores: Mapping[str, LevelScore], reference: Mapping[str, LevelScore]
) -> dict[str, float]:
    """Mean error over that of a reference on the same pairs, one or more, by level of motion."""
    return {
        level: round(score.epe_px / reference[level].epe_px, 4) for level, score in scores.items()
    }


def accuracy(matcher: Matcher, pairs: FlowPairs) -> dict[str, LevelScore]:
    """Score a network on pairs with exact flow, by level of motion."""
    scores = FlowScores()
    for k, level in enumerate(pairs.level):
        found = matcher.match(matcher.encode(pairs.current[k]), matcher.encode(pairs.other[k]))
        scores.add(found, pairs.flow[k], pairs.visible[k], int(level))
    return scores.means()


def accuracy_figures(scores: dict[str, LevelScore]) -> dict[str, float]:
    """Return the figures that a manifest keeps.

    Raises
    ------
    ModelError
        If the bundle's flow was not finite.
    """
    figures = {}
    for level, score in scores.items():
        figures[f"{level}_epe_px"] = round(score.epe_px, 3)
        figures[f"{level}_under_3px"] = round(score.under_3px, 4)
        figures[f"{level}_confident_half_epe_px"] = round(score.confident_half_epe_px, 3)
    if not np.isfinite(list(figures.values())).all():
        raise ModelError("the bundle's flow is not finite", "finite flow on every pair")
    return figures
