"""Check image: goal, frame with the flow to the goal, and the resulting command."""

import math
from collections.abc import Sequence
from typing import Any

import numpy as np

from dfvs_core.geometry.arrays import ImageArray
from dfvs_core.matching.correspondence import FlowField
from dfvs_core.matching.warping import flow_at_size
from dfvs_service.image_drawing import (
    INK,
    LINE_PX,
    PAPER,
    SOFT,
    WHITE,
    draw_flow,
    draw_flow_key,
    resized,
    write_text,
)
from dfvs_service.preflight.live_view import View

_WIDTH = 480
"""Of goal and frame, px."""
_GAP, _MARGIN = 6, 14
_PANEL_PX = 4 * LINE_PX + _MARGIN
_COLUMNS = (0, 236, 482, 764)
"""Left ends of what the panel holds, from the margin: error, command, the rest of it, key."""
_NAME_PX = 84
_STRIDE_PX = 40


def draw_image(goal: ImageArray, view: View, min_confidence: float) -> ImageArray:
    """Image (H, W, 3) RGB, with units at every number.

    Parts of ``view`` that are missing are named in the image; flow below ``min_confidence`` is not
    drawn.
    """
    shown = [_scaled(goal), _frame(view, min_confidence, _height(goal))]
    height = max(image.shape[0] for image in shown)
    canvas = np.full((height + _PANEL_PX, 2 * _WIDTH + _GAP, 3), PAPER, np.uint8)
    for image, x in zip(shown, (0, _WIDTH + _GAP), strict=True):
        canvas[: image.shape[0], x : x + _WIDTH] = image
    write_text(canvas, f"goal, {_size(goal)}", (8, 18), WHITE, shaded=True)
    label = "no camera frame" if view.image is None else f"frame, {_size(view.image)}"
    write_text(canvas, label, (_WIDTH + _GAP + 8, 18), WHITE, shaded=True)
    _write_panel(canvas, height + _MARGIN + 4, view)
    return canvas


def _frame(view: View, min_confidence: float, height: int) -> ImageArray:
    if view.image is None:
        return np.full((height, _WIDTH, 3), 60, np.uint8)
    image = _scaled(view.image)
    if view.flow is None:
        return image
    in_steps = FlowField(view.flow.flow / np.float32(view.flow.stride_px), view.flow.confidence)
    flow = flow_at_size(in_steps, (image.shape[0], _WIDTH))
    return draw_flow(image, flow, min_confidence, _STRIDE_PX)


def _write_panel(canvas: ImageArray, top: int, view: View) -> None:
    """Write the panel: error, command and key."""
    servo = view.servo
    forward, right, down, yaw = (_numbers(servo.get("velocity")) + [math.nan] * 4)[:4]
    error = [
        ("error", "to the goal"),
        ("distance", _number(servo.get("error_m"), ".3f", "m")),
        ("angle", _number(servo.get("error_rad"), ".1f", "deg", math.degrees(1.0))),
        ("overlap", _number(servo.get("overlap"), ".0f", "%", 100.0)),
    ]
    command = [
        ("command", "that would follow"),
        ("forward", _number(forward, "+.3f", "m/s")),
        ("right", _number(right, "+.3f", "m/s")),
        ("down", _number(down, "+.3f", "m/s")),
    ]
    turn = [
        ("", "(not sent; before the gate's limits)"),
        ("yaw rate", _number(yaw, "+.1f", "deg/s, right +", math.degrees(1.0))),
        ("result", str(servo.get("reason") or servo.get("status", "--")).lower()),
    ]
    for lines, x in zip((error, command, turn), _COLUMNS, strict=False):
        _write_lines(canvas, lines, (_MARGIN + x, top))
    if view.flow is None:
        write_text(canvas, "no flow to the goal", (_MARGIN + _COLUMNS[-1], top), SOFT)
    else:
        draw_flow_key(canvas, (_MARGIN + _COLUMNS[-1], top))


def _write_lines(canvas: ImageArray, lines: Sequence[tuple[str, str]], at: tuple[int, int]) -> None:
    x, y = at
    for row, (name, value) in enumerate(lines):
        write_text(canvas, name, (x, y), SOFT if row else INK)
        write_text(canvas, value, (x + (_NAME_PX if name else 0), y), INK if row else SOFT)
        y += LINE_PX


def _number(value: Any, form: str, unit: str, factor: float = 1.0) -> str:
    (number,) = _numbers([value])
    return f"{number * factor:{form}} {unit}" if math.isfinite(number) else "--"


def _numbers(values: Any) -> list[float]:
    """Values of a JSON list as numbers, NaN for what is none."""
    listed = values if isinstance(values, list) else []
    return [float(v) if isinstance(v, int | float) else math.nan for v in listed]


def _size(image: ImageArray) -> str:
    return f"{image.shape[1]} x {image.shape[0]} px"


def _height(image: ImageArray) -> int:
    height, width = image.shape[:2]
    scaled: int = round(height * _WIDTH / width)
    return scaled


def _scaled(image: ImageArray) -> ImageArray:
    return resized(image, (_height(image), _WIDTH))
