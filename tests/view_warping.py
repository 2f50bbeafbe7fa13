"""A rendered view as another camera would see it, to compare with that camera's own."""

import cv2
import numpy as np


def warp_to_a(image_b, flow):
    """Image b (H, W, 3) as seen from a, by the flow a -> b (H, W, 2) px; NaN becomes black."""
    v, u = np.mgrid[0 : flow.shape[0], 0 : flow.shape[1]].astype(np.float32)
    x = np.nan_to_num(u + flow[..., 0], nan=-1e4).astype(np.float32)
    y = np.nan_to_num(v + flow[..., 1], nan=-1e4).astype(np.float32)
    return np.asarray(cv2.remap(image_b, x, y, cv2.INTER_LINEAR), dtype=np.uint8)
