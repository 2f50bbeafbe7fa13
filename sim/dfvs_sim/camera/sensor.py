"""What a real sensor adds to a rendered image: noise, so that no two frames are the same."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from dfvs_core.geometry.arrays import ImageArray

_PATTERNS = 8


@dataclass(frozen=True, slots=True)
class SensorNoise:
    """Additive noise from a few patterns made beforehand, shifted at random for every frame.

    Drawing fresh noise for every pixel costs more than rendering the image.
    """

    patterns: np.ndarray[tuple[int, ...], np.dtype[np.int16]]

    @classmethod
    def make(cls, size: tuple[int, int], deviation: float, rng: np.random.Generator) -> SensorNoise:
        """Noise for images of (width, height) px, its deviation in grey levels."""
        width, height = size
        noise = rng.normal(0.0, deviation, (_PATTERNS, height, width, 3))
        return cls(np.rint(noise).astype(np.int16))

    def apply(self, image: ImageArray, rng: np.random.Generator) -> ImageArray:
        """Noisy copy of an image (H, W, 3)."""
        pattern = self.patterns[rng.integers(_PATTERNS)]
        shift = (int(rng.integers(image.shape[0])), int(rng.integers(image.shape[1])))
        rolled = np.roll(pattern, shift, axis=(0, 1))
        noisy: ImageArray = np.clip(image.astype(np.int16) + rolled, 0, 255).astype(np.uint8)
        return noisy
