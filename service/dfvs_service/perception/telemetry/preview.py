"""Preview image: the current view with the flow to the goal drawn on it."""

import cv2
import numpy as np

from dfvs_core.geometry.arrays import ImageArray
from dfvs_core.matching.correspondence import FlowField
from dfvs_core.servo.points import sample_grid

ARROW_STRIDE_PX = 16
CONFIDENT = (64, 235, 96)
DOUBTFUL = (255, 176, 32)
_OUTLINE = (0, 0, 0)


def draw_flow(
    image: ImageArray, flow: FlowField, min_confidence: float, stride_px: int = ARROW_STRIDE_PX
) -> ImageArray:
    """Copy of the image (H, W, 3) with arrows from trusted points to their goal.

    The points lie ``stride_px`` apart. Green arrows are confident, orange ones doubtful; points
    below ``min_confidence`` get none.
    """
    canvas = image.copy()
    samples = sample_grid(flow, stride_px)
    starts = samples.pixels.reshape(-1, 2)
    ends = starts + samples.flow.reshape(-1, 2)
    for start, end, confidence in zip(starts, ends, samples.confidence.reshape(-1), strict=True):
        if confidence < min_confidence:
            continue
        colour = CONFIDENT if confidence > 0.5 * (1.0 + min_confidence) else DOUBTFUL
        a = (int(start[0]), int(start[1]))
        b = (int(np.clip(end[0], -999, 9999)), int(np.clip(end[1], -999, 9999)))
        if a == b:
            cv2.circle(canvas, a, 1, colour, -1, cv2.LINE_AA)
            continue
        cv2.arrowedLine(canvas, a, b, _OUTLINE, 2, cv2.LINE_AA, tipLength=0.25)
        cv2.arrowedLine(canvas, a, b, colour, 1, cv2.LINE_AA, tipLength=0.25)
    return canvas
