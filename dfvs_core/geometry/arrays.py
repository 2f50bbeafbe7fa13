"""Array type aliases, and the check of an image array."""

import numpy as np
from numpy.typing import NDArray

from dfvs_core.errors import ImageError

FloatArray = NDArray[np.float64]
Float32Array = NDArray[np.float32]
IntArray = NDArray[np.intp]
BoolArray = NDArray[np.bool_]
ImageArray = NDArray[np.uint8]
"""(H, W, 3) uint8 RGB."""


def check_image(image: object) -> None:
    """Find that something is an image.

    Raises
    ------
    ImageError
        If it is not an array (H, W, 3) uint8.
    """
    expected = "uint8 of (H, W, 3), RGB"
    if not isinstance(image, np.ndarray):
        raise ImageError(f"image is of type {type(image).__name__}", expected)
    if image.ndim != 3 or image.shape[2] != 3 or image.dtype != np.uint8:
        raise ImageError(f"image is {image.dtype} of shape {image.shape}", expected)
