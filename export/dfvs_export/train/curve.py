"""A validation curve as a picture, drawn with OpenCV alone."""

from __future__ import annotations

import csv
import math
from pathlib import Path

import cv2
import numpy as np
from numpy.typing import NDArray

_SIZE = (720, 400)
_MARGIN = 50
_COLOURS = ((200, 80, 30), (40, 150, 60), (40, 40, 200))  # BGR
_LOWEST_PX, _HIGHEST_PX = 0.3, 100.0


def draw_curve(table: Path, picture: Path) -> None:
    """Draw every ``*_epe_px`` column of a CSV file against ``step``; the error on a log axis."""
    with table.open(newline="") as file:
        rows = list(csv.DictReader(file))
    columns = [name for name in rows[0] if name.endswith("_epe_px")]
    last = max(float(rows[-1]["step"]), 1.0)
    canvas = np.full((_SIZE[1], _SIZE[0], 3), 255, np.uint8)
    for value in (0.5, 1, 2, 5, 10, 20, 50):
        y = _place(0.0, value)[1]
        cv2.line(canvas, (_MARGIN, y), (_SIZE[0] - 10, y), (225, 225, 225), 1)
        _write(canvas, f"{value:g} px", (4, y + 4), (90, 90, 90))
    for colour, name in zip(_COLOURS, columns, strict=False):
        points = [_place(float(r["step"]) / last, float(r[name])) for r in rows]
        cv2.polylines(canvas, [np.array(points, np.int32)], False, colour, 2, cv2.LINE_AA)
        label = f"{name.removesuffix('_epe_px')} {float(rows[-1][name]):.2f}"
        _write(canvas, label, (points[-1][0] - 90, points[-1][1] - 8), colour)
    _write(canvas, f"{last:.0f} steps", (_SIZE[0] - 110, _SIZE[1] - 12), (90, 90, 90))
    cv2.imwrite(str(picture), canvas)


def _place(share: float, error_px: float) -> tuple[int, int]:
    """Pixel of a point of the curve."""
    span = math.log(_HIGHEST_PX / _LOWEST_PX)
    height = math.log(min(max(error_px, _LOWEST_PX), _HIGHEST_PX) / _LOWEST_PX) / span
    x = _MARGIN + share * (_SIZE[0] - _MARGIN - 20)
    return round(x), round(_SIZE[1] - 30 - height * (_SIZE[1] - 50))


def _write(
    canvas: NDArray[np.uint8], text: str, place: tuple[int, int], colour: tuple[int, int, int]
) -> None:
    cv2.putText(canvas, text, place, cv2.FONT_HERSHEY_SIMPLEX, 0.45, colour, 1, cv2.LINE_AA)
