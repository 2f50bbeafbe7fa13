"""Names for the array types that the project passes around."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

FloatArray = NDArray[np.float64]
Float32Array = NDArray[np.float32]
IntArray = NDArray[np.intp]
BoolArray = NDArray[np.bool_]
ImageArray = NDArray[np.uint8]
"""(H, W, 3) uint8 RGB."""
