"""Evaluation of flow and its confidence against ground truth."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from dfvs_core.errors import ImageError
from dfvs_core.geometry.arrays import BoolArray, Float32Array
from dfvs_core.matching.correspondence import FlowField
from dfvs_core.matching.warping import flow_at_size

LEVELS = ("small", "medium", "large")
"""Levels of motion: to 0.15 m and 6 degrees; 0.5 m and 15 degrees; 1.2 m and 30 degrees."""

_NEAR_PX = 3.0
_CONFIDENT = 0.5
_FAILED_PX = 10.0


@dataclass(frozen=True, slots=True)
class PairScore:
    """What one pair came to, over the pixels seen in both images unless said otherwise.

    Parameters
    ----------
    epe_px : float
        Mean end-point error (Baker et al. 2011).
    under_3px : float
        Share of pixels with an error under 3 px.
    confident_half_epe_px : float
        Mean error of the half with the highest confidence.
    confidence_correlation : float
        Rank correlation (Spearman) of confidence with smallness of error; 0 where constant.
    mean_confidence : float
        Over the whole image.
    confident_ratio : float
        Share of the whole image with a confidence over 0.5.
    confident_failed : float
        Share of those that are off by 3 px or not seen in the other image; 0 if none are confident.
    """

    epe_px: float
    under_3px: float
    confident_half_epe_px: float
    confidence_correlation: float
    mean_confidence: float
    confident_ratio: float
    confident_failed: float

    @property
    def confident_failures(self) -> bool:
        """Whether the match failed as a whole and did not say so."""
        return self.epe_px > _FAILED_PX and self.mean_confidence > _CONFIDENT


@dataclass(frozen=True, slots=True)
class LevelScore:
    """Means over the pairs of a level; ``confident_failures`` counts."""

    pairs: int
    epe_px: float
    under_3px: float
    confident_half_epe_px: float
    confidence_correlation: float
    confident_ratio: float
    confident_failed: float
    confident_failures: int


class FlowScores:
    """Scores of flows by level of motion."""

    def __init__(self) -> None:
        self._pairs: dict[str, list[PairScore]] = {}

    def add(self, flow: FlowField, truth: Float32Array, visible: BoolArray, level: int) -> None:
        """Score a flow of any size by :func:`score_pair`; ``level`` is an index into LEVELS."""
        score = score_pair(flow_at_size(flow, visible.shape), truth, visible)
        self._pairs.setdefault(LEVELS[level], []).append(score)

    def means(self) -> dict[str, LevelScore]:
        """Means of each level that has a pair."""
        return {name: summarise(self._pairs[name]) for name in LEVELS if name in self._pairs}


def score_pair(field: FlowField, truth: Float32Array, visible: BoolArray) -> PairScore:
    """Score a flow against the true one (H, W, 2) over the pixels ``visible`` (H, W) in both.

    Raises
    ------
    ImageError
        If the shapes differ, or nothing is visible.
    """
    if truth.shape != field.flow.shape or visible.shape != field.confidence.shape:
        raise ImageError(
            f"truth has shape {truth.shape}, visibility {visible.shape}", f"{field.flow.shape}"
        )
    if not visible.any():
        raise ImageError("no pixel is visible in both images")
    error = np.linalg.norm(field.flow - truth, axis=-1)
    seen, confidence = error[visible], field.confidence[visible]
    half = np.argsort(-confidence, kind="stable")[: (len(seen) + 1) // 2]
    confident = field.confidence > _CONFIDENT
    wrong = confident & ((error >= _NEAR_PX) | ~visible)
    return PairScore(
        epe_px=float(seen.mean()),
        under_3px=float(np.mean(seen < _NEAR_PX)),
        confident_half_epe_px=float(seen[half].mean()),
        confidence_correlation=_rank_correlation(confidence, -seen),
        mean_confidence=float(field.confidence.mean()),
        confident_ratio=float(confident.mean()),
        confident_failed=float(wrong.sum() / max(int(confident.sum()), 1)),
    )


def summarise(scores: Sequence[PairScore]) -> LevelScore:
    """Means over one pair or more."""

    def mean(name: str) -> float:
        return float(np.mean([getattr(score, name) for score in scores]))

    return LevelScore(
        pairs=len(scores),
        epe_px=mean("epe_px"),
        under_3px=mean("under_3px"),
        confident_half_epe_px=mean("confident_half_epe_px"),
        confidence_correlation=mean("confidence_correlation"),
        confident_ratio=mean("confident_ratio"),
        confident_failed=mean("confident_failed"),
        confident_failures=sum(score.confident_failures for score in scores),
    )


def _rank_correlation(a: Float32Array, b: Float32Array) -> float:
    if np.ptp(a) == 0.0 or np.ptp(b) == 0.0:
        return 0.0
    return float(np.corrcoef(_ranks(a), _ranks(b))[0, 1])


def _ranks(values: Float32Array) -> Float32Array:
    """Ranks of values (N,), equal ones sharing their mean rank."""
    _, inverse, counts = np.unique(values, return_inverse=True, return_counts=True)
    last = np.cumsum(counts)
    return np.asarray((last - 0.5 * (counts - 1))[inverse], np.float32)
