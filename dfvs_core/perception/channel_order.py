"""Channel order check of the camera images against the goal image.

A driver that takes RGB for BGR gives images that match well enough in grey, while everything
that was learnt from colours goes wrong. Points that correspond have the same colour, so the
order shows in them, whatever the light and whatever else is in view.
"""

import numpy as np

from dfvs_core.geometry.arrays import ImageArray
from dfvs_core.matching.correspondence import FlowField

STRIDE_PX = 8
MIN_CONFIDENCE = 0.5
MIN_POINTS = 40
MIN_CHROMA = 10.0
"""Mean difference of red and blue in grey levels; below it an image counts as grey."""

CLEARLY = 0.6
"""Share of the difference that must be left when red and blue are exchanged."""


def is_channel_order_swapped(image: ImageArray, goal: ImageArray, flow: FlowField) -> bool:
    """Whether red and blue of an image are exchanged against the goal image.

    Parameters
    ----------
    image, goal : (H, W, 3) uint8
    flow : FlowField
        From ``image`` to ``goal``.
    """
    height, width = goal.shape[:2]
    v, u = np.mgrid[
        STRIDE_PX // 2 : flow.flow.shape[0] : STRIDE_PX,
        STRIDE_PX // 2 : flow.flow.shape[1] : STRIDE_PX,
    ]
    confident = flow.confidence[v, u] >= MIN_CONFIDENCE
    v, u = v[confident], u[confident]
    to = np.rint(flow.flow[v, u]).astype(np.int64)
    goal_u, goal_v = u + to[:, 0], v + to[:, 1]
    inside = (goal_u >= 0) & (goal_u < width) & (goal_v >= 0) & (goal_v < height)
    if inside.sum() < MIN_POINTS:
        return False
    here = image[v[inside], u[inside]].astype(np.float32)
    there = goal[goal_v[inside], goal_u[inside]].astype(np.float32)
    contrast_here, contrast_there = here[:, 0] - here[:, 2], there[:, 0] - there[:, 2]
    if min(np.abs(contrast_here).mean(), np.abs(contrast_there).mean()) < MIN_CHROMA:
        return False
    as_is = np.abs(contrast_here - contrast_there).mean()
    exchanged = np.abs(contrast_here + contrast_there).mean()
    return bool(exchanged < CLEARLY * as_is)
