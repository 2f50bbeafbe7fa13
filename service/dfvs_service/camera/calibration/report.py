"""Report of a calibration: figures as a document, and an image of the coverage."""

from collections.abc import Sequence
from typing import Any

import cv2
import numpy as np

from dfvs_core.geometry.arrays import ImageArray
from dfvs_core.messages.schema import dump
from dfvs_service.camera.calibration.boards import BoardView
from dfvs_service.camera.calibration.coverage import COLUMNS, ROWS, Coverage
from dfvs_service.camera.calibration.intrinsics import Calibration

_PAPER, _INK, _GRID = (250, 250, 248), (30, 34, 40), (214, 216, 220)
_GOOD, _BAD = (36, 122, 87), (200, 60, 40)
_WIDTH_PX, _MARGIN_PX, _BAR_PX, _LABEL_PX = 640, 16, 18, 220
_FONT = cv2.FONT_HERSHEY_SIMPLEX


def report_document(calibration: Calibration, coverage: Coverage) -> dict[str, Any]:
    """Everything in figures; px, corners counted."""
    names = ("fx", "fy", "cx", "cy")
    return {
        "camera": dump(calibration.camera),
        "rms_px": round(calibration.rms_px, 4),
        "deviations_px": {
            name: round(value, 3)
            for name, value in zip(names, calibration.deviations_px, strict=True)
        },
        "pictures": [
            {
                "name": view.name,
                "error_px": round(view.error_px, 4),
                "corners": view.corners,
                "used": view.is_used,
            }
            for view in calibration.views
        ],
        "coverage": {
            "corners": coverage.corners.tolist(),
            "tilts": coverage.tilts,
            "near": coverage.near,
        },
        "missing": coverage.advice(),
        "doubts": calibration.doubts(),
    }


def coverage_image(views: Sequence[BoardView], calibration: Calibration) -> ImageArray:
    """Image (H, W, 3): where corners were seen, and every image's error as a bar."""
    camera = calibration.camera
    scale = _WIDTH_PX / camera.width
    plan = np.full((round(camera.height * scale), _WIDTH_PX, 3), _PAPER, np.uint8)
    for i in range(1, COLUMNS):
        cv2.line(plan, (_WIDTH_PX * i // COLUMNS, 0), (_WIDTH_PX * i // COLUMNS, 9999), _GRID)
    for i in range(1, ROWS):
        y = plan.shape[0] * i // ROWS
        cv2.line(plan, (0, y), (9999, y), _GRID)
    used = {view.name: view.is_used for view in calibration.views}
    for view in views:
        colour = _GOOD if used.get(view.name, False) else _BAD
        for u, v in (view.pixels + 0.5) * scale:
            cv2.circle(plan, (int(u), int(v)), 2, colour, -1, cv2.LINE_AA)
    cv2.rectangle(plan, (0, 0), (plan.shape[1] - 1, plan.shape[0] - 1), _INK)
    rows = [_title(calibration), plan, _bars(calibration)]
    return np.concatenate([_framed(row) for row in rows], axis=0)


def _framed(image: ImageArray) -> ImageArray:
    """Image on paper, with a margin."""
    height, width = image.shape[:2]
    sheet = np.full((height + _MARGIN_PX, width + 2 * _MARGIN_PX, 3), _PAPER, np.uint8)
    top = _MARGIN_PX // 2
    sheet[top : top + height, _MARGIN_PX : _MARGIN_PX + width] = image
    return sheet


def _title(calibration: Calibration) -> ImageArray:
    camera = calibration.camera
    strip = np.full((28, _WIDTH_PX, 3), _PAPER, np.uint8)
    text = (
        f"{camera.width} x {camera.height} px, fx {camera.fx:.1f}, fy {camera.fy:.1f}, "
        f"rms {calibration.rms_px:.3f} px"
    )
    cv2.putText(strip, text, (0, 20), _FONT, 0.55, _INK, 1, cv2.LINE_AA)
    return strip


def _bars(calibration: Calibration) -> ImageArray:
    """Reprojection error of every image."""
    strip = np.full((_BAR_PX * len(calibration.views), _WIDTH_PX, 3), _PAPER, np.uint8)
    greatest = max(max(view.error_px for view in calibration.views), 1e-6)
    for i, view in enumerate(calibration.views):
        y = i * _BAR_PX
        length = round((_WIDTH_PX - _LABEL_PX - 70) * view.error_px / greatest)
        end = (_LABEL_PX + length, y + _BAR_PX - 5)
        cv2.rectangle(strip, (_LABEL_PX, y + 3), end, _GOOD if view.is_used else _BAD, -1)
        label = view.name if len(view.name) <= 26 else "..." + view.name[-23:]
        cv2.putText(strip, label, (0, y + 13), _FONT, 0.42, _INK, 1, cv2.LINE_AA)
        value = f"{view.error_px:.3f} px"
        cv2.putText(strip, value, (end[0] + 6, y + 13), _FONT, 0.42, _INK, 1, cv2.LINE_AA)
    return strip
