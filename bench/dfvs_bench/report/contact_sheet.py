"""Images of tasks side by side, to be looked at."""

import math
from collections.abc import Sequence

import cv2
import numpy as np

from dfvs_bench.trials.task import BenchTask
from dfvs_core.geometry.arrays import ImageArray
from dfvs_sim.render.renderer import Renderer
from dfvs_sim.scene.glb import load_glb

_WIDTH_PX, _GAP_PX, _TEXT_PX = 480, 10, 34
_PAIRS_A_ROW = 2
_WHITE, _INK = 255, (40, 40, 40)


def contact_sheet(tasks: Sequence[BenchTask]) -> ImageArray:
    """Start (left) and goal (right) of every task with its name, two tasks a row; (H, W, 3)."""
    cells = [_cell(task) for task in tasks]
    height = max(cell.shape[0] for cell in cells)
    width = max(cell.shape[1] for cell in cells)
    rows = math.ceil(len(cells) / _PAIRS_A_ROW)
    sheet: ImageArray = np.full((rows * height, _PAIRS_A_ROW * width, 3), _WHITE, np.uint8)
    for k, cell in enumerate(cells):
        j, i = divmod(k, _PAIRS_A_ROW)
        sheet[j * height :, i * width :][: cell.shape[0], : cell.shape[1]] = cell
    return sheet


def _cell(task: BenchTask) -> ImageArray:
    renderer = Renderer(load_glb(task.scene))
    poses = (task.T_world_start, task.T_world_goal)
    camera = task.camera.scaled(
        _WIDTH_PX, round(_WIDTH_PX * task.camera.height / task.camera.width)
    )
    views = [renderer.render(camera, T, antialias=True).image for T in poses]
    height, width = views[0].shape[:2]
    shape = (height + _TEXT_PX + _GAP_PX, 2 * width + 3 * _GAP_PX, 3)
    cell: ImageArray = np.full(shape, _WHITE, np.uint8)
    for k, view in enumerate(views):
        left = _GAP_PX + k * (width + _GAP_PX)
        cell[_TEXT_PX : _TEXT_PX + height, left : left + width] = view
    distance_m, angle_rad = task.initial_error
    text = f"{task.name}  {task.difficulty}  {distance_m:.2f} m, {math.degrees(angle_rad):.0f} deg"
    font = cv2.FONT_HERSHEY_SIMPLEX
    cv2.putText(cell, text, (_GAP_PX, _TEXT_PX - 11), font, 0.65, _INK, 1, cv2.LINE_AA)
    return cell
