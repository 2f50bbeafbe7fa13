"""Texture mask of an image."""

from __future__ import annotations

import cv2
import numpy as np

from dfvs_core.geometry.arrays import BoolArray, ImageArray
from dfvs_core.matching.config import PATCH_PX, MatchingConfig


def has_texture(grey: ImageArray, config: MatchingConfig | None = None) -> BoolArray:
    """(H, W): whether the patch around a pixel of a grey image could be matched."""
    u, v = (cv2.Sobel(grey, cv2.CV_32F, *order) for order in ((1, 0), (0, 1)))
    square = cv2.blur(u * u + v * v, (PATCH_PX + 1, PATCH_PX + 1))
    return np.asarray(square > (config or MatchingConfig()).least_gradient ** 2)
