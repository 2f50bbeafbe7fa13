"""Depth of the pixels of an image."""

from __future__ import annotations

from dataclasses import dataclass

import cv2
import numpy as np

from dfvs_core.errors import ImageError
from dfvs_core.geometry.arrays import BoolArray, Float32Array

_MEASURED = 0.1
"""Validity from which on a depth is more than a guess."""


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

    @property
    def measured(self) -> BoolArray:
        """Which depths (H, W) are more than a guess."""
        measured: BoolArray = self.validity > _MEASURED
        return measured

    def resized(self, size: tuple[int, int]) -> DepthMap:
        """The same depth at ``size`` (height, width), by the nearest pixel."""
        z_m, validity = (
            np.asarray(cv2.resize(v, size[::-1], interpolation=cv2.INTER_NEAREST_EXACT), np.float32)
            for v in (self.z_m, self.validity)
        )
        return DepthMap(z_m, validity)
