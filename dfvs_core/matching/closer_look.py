"""Parts of a picture, enlarged to its own size: what is far away fills more of them.

A network that works at 256 px of width sees little of what takes up a tenth of a picture, and so
does dense inverse search, whose patches have 8 px. Enlarged, both find it. Points are in OpenCV's
pixel coordinates, the first pixel's centre at (0, 0). A part may be turned as well: a network
that was trained on little roll finds what was seen at a large one.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import cast

import cv2
import numpy as np
from numpy.typing import NDArray

from dfvs_core.arrays import BoolArray, Float32Array, ImageArray
from dfvs_core.correspondence import FlowField
from dfvs_core.matching.warping import pixel_grid, sample

_SURE = 0.5
_LEAST_ZOOM, _MOST_ZOOM = 1.5, 3.0
_ROOM = 0.08
"""Of the picture's width and height, at each side of what is sure."""
_CUT_OFF = 0.02
"""Share of what is sure that may lie outside at each side."""


@dataclass(frozen=True, slots=True)
class Part:
    """A part of a picture of the same shape, turned about its own centre.

    Parameters
    ----------
    zoom : float
        How many times the part is enlarged.
    left, top : float
        Where it begins: 0 at the picture's left or upper edge, 1 where it ends at the other one.
    turn_rad : float
        What is at the right in the part is so much clockwise from there in the picture. Its corners
        may be outside of that then.
    """

    zoom: float
    left: float
    top: float
    turn_rad: float = 0.0

    def cut(self, image: ImageArray) -> ImageArray:
        """Return the part of a picture (H, W) or (H, W, 3), enlarged to the same shape."""
        height, width = image.shape[:2]
        corners = np.array([[0.0, 0.0], [1.0, 0.0], [0.0, 1.0]], np.float32)
        first, right, down = self._in_picture(corners, (height, width))
        inverse = np.stack([right - first, down - first, first], axis=1).astype(np.float64)
        flags = cv2.INTER_LINEAR | cv2.WARP_INVERSE_MAP
        cut = cv2.warpAffine(
            image, inverse, (width, height), flags=flags, borderMode=cv2.BORDER_REPLICATE
        )
        return cast(ImageArray, cut)

    def inside(self, size: tuple[int, int]) -> BoolArray:
        """(H, W): which of the part's pixels show the picture (height, width)."""
        return _is_inside(self._in_picture(pixel_grid(size), size), size)

    def of(self, field: FlowField) -> FlowField:
        """Flow (H, W) from the enlarged part, of that from the whole picture."""
        size = (field.confidence.shape[0], field.confidence.shape[1])
        at = self._in_picture(pixel_grid(size), size)
        flow = sample(field.flow, at) + at - pixel_grid(size)
        return FlowField(flow, sample(field.confidence, at))

    def whole(self, field: FlowField) -> FlowField:
        """Flow from the whole picture, of which nothing is known outside the part.

        Parameters
        ----------
        field : FlowField
            From the enlarged part (H, W) to another picture.
        """
        size = (field.confidence.shape[0], field.confidence.shape[1])
        upright = (pixel_grid(size) - self._first(size)) * np.float32(self.zoom)
        at = _turn(upright, -self.turn_rad, size)
        side = 2 * round(0.5 * self.zoom) + 1
        confidence = sample(cast(Float32Array, cv2.blur(field.confidence, (side, side))), at)
        flow = sample(field.flow, at) + at - pixel_grid(size)
        return FlowField(flow, confidence * _is_inside(at, size))

    def _in_picture(self, at: Float32Array, size: tuple[int, int]) -> Float32Array:
        """Where points (..., 2) of the part are in a picture (height, width)."""
        return _turn(at, self.turn_rad, size) / np.float32(self.zoom) + self._first(size)

    def _first(self, size: tuple[int, int]) -> Float32Array:
        """Where the centre of the enlarged part's first pixel is in a picture (height, width)."""
        room = np.array([size[1], size[0]]) * (1.0 - 1.0 / self.zoom)
        corner = room * [self.left, self.top]
        return np.asarray(corner + 0.5 / self.zoom - 0.5, np.float32)


def _turn(at: Float32Array, angle_rad: float, size: tuple[int, int]) -> Float32Array:
    """Points (..., 2) turned clockwise about the middle of a picture (height, width)."""
    if angle_rad == 0.0:
        return at
    c, s = math.cos(angle_rad), math.sin(angle_rad)
    middle = 0.5 * (np.array(size[::-1], np.float32) - 1.0)
    turn = np.array([[c, s], [-s, c]], np.float32)
    return np.asarray((at - middle) @ turn + middle, np.float32)


def _is_inside(at: Float32Array, size: tuple[int, int]) -> BoolArray:
    """Which of the points (..., 2) are between the pixels' centres of a picture."""
    return np.asarray(((at >= 0.0) & (at <= np.array(size[::-1]) - 1.0)).all(axis=-1))


def part_around(field: FlowField) -> Part | None:
    """Part around what is sure of a flow, with some room; None if that is no small part."""
    sure = field.confidence > _SURE
    if not sure.any():
        return None
    (left, right), (top, bottom) = _extent(sure.sum(axis=0)), _extent(sure.sum(axis=1))
    zoom = min(_MOST_ZOOM, 1.0 / (max(right - left, bottom - top) + 2.0 * _ROOM))
    if zoom < _LEAST_ZOOM:
        return None
    corner = [0.5 * (left + right - 1.0 / zoom), 0.5 * (top + bottom - 1.0 / zoom)]
    begin = np.clip(np.array(corner) / (1.0 - 1.0 / zoom), 0.0, 1.0)
    return Part(zoom, float(begin[0]), float(begin[1]))


def _extent(counts: NDArray[np.intp]) -> tuple[float, float]:
    """From where to where nearly all of the counts are, as shares of their length."""
    until = np.cumsum(counts) / counts.sum()
    low, high = np.searchsorted(until, (_CUT_OFF, 1.0 - _CUT_OFF))
    return float(low / len(counts)), float((high + 1) / len(counts))


def _parts(zoom: float, count: int, turn_rad: float = 0.0) -> list[Part]:
    """Parts in ``count`` rows and columns."""
    steps = [k / (count - 1) for k in range(count)]
    return [Part(zoom, left, top, turn_rad) for top in steps for left in steps]


Stages = Sequence[Sequence[Part]]
"""Parts to look at; those of a later stage where the stages before show nothing."""

STAGES: Stages = ([*_parts(1.5, 2), *_parts(2.0, 3)], _parts(3.0, 5))
"""Parts that overlap by half or more, and smaller ones for where these show nothing."""

_ROLLS_RAD = (math.radians(-45.0), math.radians(45.0))

TURNED_STAGES: Stages = (
    [
        part
        for turn_rad in _ROLLS_RAD
        for part in (
            Part(1.0, 0.0, 0.0, turn_rad),
            *_parts(1.5, 2, turn_rad),
            *_parts(2.0, 3, turn_rad),
        )
    ],
)
"""The whole picture and large parts of it, turned: for cameras that may roll."""
