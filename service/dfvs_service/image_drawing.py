"""Text, scaling, flow and its colour key for images."""

import cv2
import numpy as np

from dfvs_core.geometry.arrays import ImageArray
from dfvs_core.matching.correspondence import FlowField
from dfvs_core.servo.points import sample_grid

Colour = tuple[int, int, int]

PAPER, INK, SOFT, WHITE = (22, 27, 34), (230, 237, 243), (145, 152, 161), (255, 255, 255)
LINE_PX = 19
_CONFIDENT, _DOUBTFUL, _OUTLINE = (64, 235, 96), (255, 176, 32), (0, 0, 0)


def write_text(
    image: ImageArray, text: str, at: tuple[int, int], colour: Colour, *, shaded: bool = False
) -> None:
    """Write ASCII text into an image (H, W, 3), its baseline's left end at (x, y) px."""
    font, scale = cv2.FONT_HERSHEY_SIMPLEX, 0.42
    if shaded:
        for right, down in ((1, 1), (1, 0), (0, 1)):
            below = at[0] + right, at[1] + down
            cv2.putText(image, text, below, font, scale, (0, 0, 0), 1, cv2.LINE_AA)
    cv2.putText(image, text, at, font, scale, colour, 1, cv2.LINE_AA)


def draw_flow(
    image: ImageArray, flow: FlowField, min_confidence: float, stride_px: int = 16
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
        colour = _CONFIDENT if confidence > 0.5 * (1.0 + min_confidence) else _DOUBTFUL
        a = (int(start[0]), int(start[1]))
        b = (int(np.clip(end[0], -999, 9999)), int(np.clip(end[1], -999, 9999)))
        if a == b:
            cv2.circle(canvas, a, 1, colour, -1, cv2.LINE_AA)
            continue
        cv2.arrowedLine(canvas, a, b, _OUTLINE, 2, cv2.LINE_AA, tipLength=0.25)
        cv2.arrowedLine(canvas, a, b, colour, 1, cv2.LINE_AA, tipLength=0.25)
    return canvas


def draw_flow_key(image: ImageArray, at: tuple[int, int]) -> None:
    """Write a legend of the arrows of the flow, three lines from (x, y) px on."""
    x, y = at
    write_text(image, "flow to the goal", (x, y), SOFT)
    for text, colour in (("confident", _CONFIDENT), ("doubtful", _DOUBTFUL)):
        y += LINE_PX
        cv2.arrowedLine(image, (x + 84, y - 4), (x + 110, y - 4), colour, 1, cv2.LINE_AA, 0, 0.35)
        write_text(image, text, (x + 120, y), INK)


def at_width(image: ImageArray, width_px: int) -> ImageArray:
    """Image (H, W, 3) made so wide, at its own ratio of sides."""
    height, width = image.shape[:2]
    size = (width_px, max(round(height * width_px / width), 1))
    return np.asarray(cv2.resize(image, size, interpolation=cv2.INTER_AREA), np.uint8)


def resized(image: ImageArray, size: tuple[int, int]) -> ImageArray:
    """Image at a size (height, width)."""
    is_smaller = size[0] < image.shape[0]
    way = cv2.INTER_AREA if is_smaller else cv2.INTER_CUBIC
    return np.asarray(cv2.resize(image, size[::-1], interpolation=way), np.uint8)
