"""Confidence of flow fields: confident ratio, merging, exclusion."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from dfvs_core.geometry.arrays import BoolArray
from dfvs_core.matching.config import MatchingConfig
from dfvs_core.matching.correspondence import FlowField
from dfvs_core.matching.points import PointMatches

CONFIDENT = 0.5
"""Confidence above which a vector is more likely right than wrong."""


def confident_ratio(field: FlowField) -> float:
    """Share of the image whose flow is confident."""
    return float(np.mean(field.confidence > CONFIDENT))


def merge_by_confidence(first: FlowField, second: FlowField) -> FlowField:
    """Take the more confident of two flows at each pixel."""
    better = second.confidence > first.confidence
    flow = np.where(better[..., None], second.flow, first.flow)
    return FlowField(flow, np.maximum(first.confidence, second.confidence))


def empty_flow(size: tuple[int, int]) -> FlowField:
    """Flow of an image of ``size`` (height, width) without any confidence."""
    return FlowField(np.zeros((*size, 2), np.float32), np.zeros(size, np.float32))


def exclude(field: FlowField, excluded: Sequence[FlowField], config: MatchingConfig) -> FlowField:
    """Flow without confidence where it leads to the same place as one that is excluded."""
    for wrong in excluded:
        apart_px = np.linalg.norm(field.flow - wrong.flow, axis=2)
        kept = apart_px >= config.same_px
        field = FlowField(field.flow, field.confidence * kept)
    return field


def is_excluded(
    matches: PointMatches, excluded: Sequence[FlowField], config: MatchingConfig
) -> BoolArray:
    """Mask (N,) of the matches that lead to the same place as a flow that is excluded."""
    same: BoolArray = np.zeros(len(matches), bool)
    for wrong in excluded:
        same |= matches.miss_px(wrong.flow) < config.same_px
    return same
