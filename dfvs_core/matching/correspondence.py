"""Flow fields with a confidence."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from dfvs_core.errors import ImageError
from dfvs_core.geometry.arrays import Float32Array
from dfvs_core.matching.config import MatchingConfig

CONFIDENT = 0.5
"""Confidence above which a vector is more likely right than wrong."""


@dataclass(frozen=True, slots=True)
class FlowField:
    """Optical flow from a first image to a second, on the first one's grid.

    Parameters
    ----------
    flow : (H, W, 2) float32
        Displacement (du, dv) in px: the point at pixel p is seen at ``p + flow`` in the second.
    confidence : (H, W) float32
        0 (worthless, or not visible in the second image) to 1 (certain).
    """

    flow: Float32Array
    confidence: Float32Array

    def __post_init__(self) -> None:
        """Check shapes and types once, so that nobody downstream has to."""
        if self.flow.ndim != 3 or self.flow.shape[2] != 2 or self.flow.dtype != np.float32:
            raise ImageError(
                f"flow is {self.flow.dtype} of shape {self.flow.shape}", "float32 of (H, W, 2)"
            )
        shape = self.flow.shape[:2]
        if self.confidence.shape != shape or self.confidence.dtype != np.float32:
            raise ImageError(
                f"confidence is {self.confidence.dtype} of shape {self.confidence.shape}",
                f"float32 of {shape}",
            )

    def is_finite(self) -> bool:
        """Whether every value is a finite number."""
        return bool(np.isfinite(self.flow).all() and np.isfinite(self.confidence).all())


def empty_flow(size: tuple[int, int]) -> FlowField:
    """Flow of an image of ``size`` (height, width) without any confidence."""
    return FlowField(np.zeros((*size, 2), np.float32), np.zeros(size, np.float32))


def confident_ratio(field: FlowField) -> float:
    """Share of the image whose flow is confident."""
    return float(np.mean(field.confidence > CONFIDENT))


def merge_by_confidence(first: FlowField, second: FlowField) -> FlowField:
    """Take the more confident of two flows at each pixel."""
    better = second.confidence > first.confidence
    flow = np.where(better[..., None], second.flow, first.flow)
    return FlowField(flow, np.maximum(first.confidence, second.confidence))


def exclude(field: FlowField, excluded: Sequence[FlowField], config: MatchingConfig) -> FlowField:
    """Flow without confidence where it leads to the same place as one that is excluded."""
    for wrong in excluded:
        kept = np.linalg.norm(field.flow - wrong.flow, axis=2) >= config.same_px
        field = FlowField(field.flow, field.confidence * kept)
    return field
