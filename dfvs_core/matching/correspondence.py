"""Flow fields with a confidence, and depth maps."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import cv2
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


@dataclass(frozen=True, slots=True)
class DepthMap:
    """Distance along the optical axis for the pixels of an image, or for a grid of them.

    Parameters
    ----------
    z_m : (H, W) float32
        Depth in m, positive and finite everywhere (a guess where ``validity`` is 0).
    validity : (H, W) float32
        0 (a mere guess) to 1 (measured).
    """

    z_m: Float32Array
    validity: Float32Array

    def __post_init__(self) -> None:
        """Check shapes and values."""
        if self.z_m.ndim != 2 or self.validity.shape != self.z_m.shape:
            raise ImageError(
                f"depth of shape {self.z_m.shape} with validity of {self.validity.shape}",
                "two arrays of (H, W)",
            )
        if not (np.isfinite(self.z_m).all() and (self.z_m > 0).all()):
            raise ImageError("depth holds values that are not finite or not positive")

    def resized(self, size: tuple[int, int]) -> DepthMap:
        """The same depth at ``size`` (height, width), by the nearest pixel."""
        z_m, validity = (
            np.asarray(cv2.resize(v, size[::-1], interpolation=cv2.INTER_NEAREST_EXACT), np.float32)
            for v in (self.z_m, self.validity)
        )
        return DepthMap(z_m, validity)
