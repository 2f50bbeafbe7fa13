"""Coverage of image regions and board tilts by calibration images."""

from collections.abc import Sequence
from dataclasses import dataclass

import cv2
import numpy as np
from numpy.typing import NDArray

from dfvs_core.geometry.arrays import FloatArray
from dfvs_service.camera.calibration.boards import BoardView

COLUMNS, ROWS = 4, 3
ENOUGH_VIEWS, ENOUGH_CORNERS, ENOUGH_TILTED = 12, 6, 2
TILT_RAD = np.radians(15.0)
NEAR_SHARE = 0.25
"""A board that fills this share of the image was held near."""

_PLACES = (
    ("top left", "top", "top", "top right"),
    ("left", "middle", "middle", "right"),
    ("bottom left", "bottom", "bottom", "bottom right"),
)
_TILTS = {
    "left": "turn its left edge away",
    "right": "turn its right edge away",
    "up": "lean its upper edge away",
    "down": "lean its lower edge away",
}


@dataclass(frozen=True, slots=True)
class Coverage:
    """What was seen so far.

    ``corners`` counts those seen in each cell of the image. ``tilts`` counts the images with the
    board's edge of that name turned away by 15 degrees or more, ``near`` those in which it fills a
    quarter of the image or more, and ``views`` all with a board.
    """

    corners: NDArray[np.int64]
    tilts: dict[str, int]
    near: int
    views: int

    def advice(self) -> list[str]:
        """What is missing, as sentences for the person who holds the board; empty: nothing."""
        lines = []
        if self.views < ENOUGH_VIEWS:
            lines.append(f"take {ENOUGH_VIEWS - self.views} more images")
        bare = {
            _PLACES[row][column]: None
            for row in range(ROWS)
            for column in range(COLUMNS)
            if self.corners[row, column] < ENOUGH_CORNERS
        }
        if bare:
            lines.append(f"show the board at the {', the '.join(bare)}")
        lines += [
            f"{what} in {ENOUGH_TILTED - self.tilts[name]} more"
            for name, what in _TILTS.items()
            if self.tilts[name] < ENOUGH_TILTED
        ]
        if not self.near:
            lines.append("hold it so near that it fills a quarter of the image")
        return lines


def coverage_of(views: Sequence[BoardView], size: tuple[int, int]) -> Coverage:
    """Coverage by images of (width, height) px."""
    width, height = size
    corners = np.zeros((ROWS, COLUMNS), np.int64)
    tilts = dict.fromkeys(_TILTS, 0)
    near = 0
    for view in views:
        column = np.clip(view.pixels[:, 0] * COLUMNS / width, 0, COLUMNS - 1).astype(int)
        row = np.clip(view.pixels[:, 1] * ROWS / height, 0, ROWS - 1).astype(int)
        np.add.at(corners, (row, column), 1)
        for name in _tilts(view, size):
            tilts[name] += 1
        hull = cv2.convexHull(view.pixels)
        near += float(cv2.contourArea(hull)) > NEAR_SHARE * width * height
    return Coverage(corners, tilts, near, len(views))


def _tilts(view: BoardView, size: tuple[int, int]) -> list[str]:
    """Edges of the image at which the board is turned away, by a rough guess of the lens."""
    x, y = _normal(view, size)
    found = []
    if abs(x) > np.sin(TILT_RAD):
        found.append("left" if x > 0 else "right")
    if abs(y) > np.sin(TILT_RAD):
        found.append("up" if y > 0 else "down")
    return found


def _normal(view: BoardView, size: tuple[int, int]) -> FloatArray:
    """First two components (2,) of the board's normal, away from the camera, in optical axes."""
    width, height = size
    f = 0.9 * width
    K = np.array([[f, 0, 0.5 * width], [0, f, 0.5 * height], [0, 0, 1.0]])
    ok, rotation, _ = cv2.solvePnP(view.points_m, view.pixels, K, np.zeros(4))
    if not ok:
        return np.zeros(2)
    normal = np.asarray(cv2.Rodrigues(rotation)[0], np.float64)[:, 2]
    return normal[:2] * (1.0 if normal[2] > 0 else -1.0)
