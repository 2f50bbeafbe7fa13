"""Images of a flight: first and last view, their difference from the goal, a film strip."""

from __future__ import annotations

from pathlib import Path

import cv2
import numpy as np

from dfvs_core.arrays import FloatArray, ImageArray
from dfvs_core.wire.picture import encode_png
from dfvs_sim.demo.flight import FlightLog

_STRIP_VIEWS = 6
_MARGIN_PX = 8
_CAPTION_PX = 26
_INK = (30, 34, 40)
_PAPER = (250, 250, 248)


def write_images(log: FlightLog, folder: Path) -> list[Path]:
    """Write first.png, last.png, difference.png, flow.jpg and filmstrip.png; return the paths."""
    flown = [p for p in log.track.points if p.t_ns >= log.engaged_ns]
    if not flown:
        return []
    goal = log.plan.goal_image()
    views = {
        "first.png": _view(log, flown[0].T_scene_camera),
        "last.png": _view(log, flown[-1].T_scene_camera),
    }
    images = {
        **views,
        "difference.png": _side_by_side(
            [
                ("first view - goal", _difference(views["first.png"], goal)),
                ("last view - goal", _difference(views["last.png"], goal)),
            ]
        ),
        "filmstrip.png": _filmstrip(log, goal),
    }
    paths = []
    for name, image in images.items():
        paths.append(folder / name)
        paths[-1].write_bytes(encode_png(image))
    if log.watch.preview is not None:
        paths.append(folder / "flow.jpg")
        paths[-1].write_bytes(log.watch.preview)
    return paths


def _view(log: FlightLog, T_scene_camera: FloatArray) -> ImageArray:
    return log.plan.renderer.render(log.plan.camera, T_scene_camera, antialias=True).image


def _difference(view: ImageArray, goal: ImageArray) -> ImageArray:
    """Signed difference around middle grey, as in the paper's Fig. 4: grey is perfect."""
    signed = (view.astype(np.int16) - goal.astype(np.int16)) // 2 + 128
    return np.clip(signed, 0, 255).astype(np.uint8)


def _filmstrip(log: FlightLog, goal: ImageArray) -> ImageArray:
    """Views at even steps of the way that was left, and the goal."""
    flown = [p for p in log.track.points if p.t_ns >= log.engaged_ns]
    errors = np.minimum.accumulate([p.error_m for p in flown])
    targets = np.linspace(errors[0], errors[-1], _STRIP_VIEWS)
    chosen = [int(np.argmax(errors <= target + 1e-9)) for target in targets]
    captions = []
    for i in chosen:
        seconds = (flown[i].t_ns - log.engaged_ns) * 1e-9
        degrees = np.degrees(flown[i].error_rad)
        caption = f"{seconds:.1f} s: {flown[i].error_m:.2f} m, {degrees:.1f} deg"
        captions.append((caption, _view(log, flown[i].T_scene_camera)))
    captions.append(("goal image", goal))
    captions.append(("last view - goal", _difference(captions[-2][1], goal)))
    rows = [_side_by_side(captions[i : i + 4]) for i in range(0, len(captions), 4)]
    return np.concatenate(rows, axis=0)


def _side_by_side(captioned: list[tuple[str, ImageArray]]) -> ImageArray:
    tiles = []
    for caption, image in captioned:
        height, width = image.shape[:2]
        shape = (height + _CAPTION_PX + _MARGIN_PX, width + 2 * _MARGIN_PX, 3)
        tile = np.empty(shape, np.uint8)
        tile[:] = _PAPER
        tile[_CAPTION_PX : _CAPTION_PX + height, _MARGIN_PX : _MARGIN_PX + width] = image
        origin = (_MARGIN_PX, _CAPTION_PX - 8)
        cv2.putText(tile, caption, origin, cv2.FONT_HERSHEY_SIMPLEX, 0.48, _INK, 1, cv2.LINE_AA)
        tiles.append(tile)
    return np.concatenate(tiles, axis=1)
