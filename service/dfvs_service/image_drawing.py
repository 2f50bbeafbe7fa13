"""Text, scaling and the flow's colour key for images."""

import cv2
import numpy as np

from dfvs_core.geometry.arrays import ImageArray
from dfvs_service.perception.telemetry.preview import CONFIDENT, DOUBTFUL

Colour = tuple[int, int, int]

PAPER, INK, SOFT, WHITE = (22, 27, 34), (230, 237, 243), (145, 152, 161), (255, 255, 255)
LINE_PX = 19


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


def draw_flow_key(image: ImageArray, at: tuple[int, int]) -> None:
    """Write a legend of the arrows of the flow, three lines from (x, y) px on."""
    x, y = at
    write_text(image, "flow to the goal", (x, y), SOFT)
    for text, colour in (("confident", CONFIDENT), ("doubtful", DOUBTFUL)):
        y += LINE_PX
        cv2.arrowedLine(image, (x + 84, y - 4), (x + 110, y - 4), colour, 1, cv2.LINE_AA, 0, 0.35)
        write_text(image, text, (x + 120, y), INK)


def resized(image: ImageArray, size: tuple[int, int]) -> ImageArray:
    """Image at a size (height, width)."""
    is_smaller = size[0] < image.shape[0]
    way = cv2.INTER_AREA if is_smaller else cv2.INTER_CUBIC
    return np.asarray(cv2.resize(image, size[::-1], interpolation=way), np.uint8)
