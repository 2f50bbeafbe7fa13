"""Where a picture has something that could be matched."""

from __future__ import annotations

import cv2
import numpy as np

from dfvs_core.arrays import BoolArray, ImageArray

_GREY = 15.0
"""Size of Sobel's gradient, in the mean around a pixel, from which on it has texture."""
_PATCH = (9, 9)


def has_texture(grey: ImageArray) -> BoolArray:
    """(H, W): whether there is something around a pixel of a grey picture that could be matched."""
    u, v = (cv2.Sobel(grey, cv2.CV_32F, *order) for order in ((1, 0), (0, 1)))
    return np.asarray(cv2.blur(u * u + v * v, _PATCH) > _GREY**2)
