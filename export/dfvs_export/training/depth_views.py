"""Views with depth to train dfvs-depth on: drawn from wide-baseline pairs, cropped, augmented."""

import math
from dataclasses import dataclass

import cv2
import numpy as np

from dfvs_core.geometry.arrays import Float32Array, FloatArray
from dfvs_export.networks.depth import NORMALS_STRIDE, SIZE, STRIDE
from dfvs_export.training.room_pairs import RoomReader, augmented, view_of

_ZOOM = 1.8
"""The longest focal length in that of the rendered view."""
_ROLLED, _ROLL_RAD = 0.35, math.radians(50.0)
"""Share of views that are turned about the optical axis, and by how much at most."""
_SMOOTH = 0.08
"""Relative change of depth over a cell up to which it has a normal."""


@dataclass(frozen=True, slots=True)
class DepthView:
    """An augmented view.

    ``image`` (240, 320) is grey, 0 to 1; ``depth_m`` (120, 160) along the optical axis, 0 where it
    is unknown; ``normals`` (60, 80, 3) of unit length in the camera's axes, 0 where unknown;
    ``focal`` is the focal length over the image's width.
    """

    image: Float32Array
    depth_m: Float32Array
    normals: Float32Array
    focal: float


class DepthViewReader(RoomReader):
    """Draws augmented views from a folder of wide-baseline pairs."""

    def draw(self) -> DepthView:
        """Draw the next view."""
        rng = self._rng
        room, k = self._draw_pair()
        side = rng.integers(2)
        image = view_of(room, k, "ab"[side])
        depth_m = room["D"][k][side].astype(np.float32)
        height, width = image.shape
        zoom = _ZOOM ** rng.uniform()
        roll = rng.uniform(-_ROLL_RAD, _ROLL_RAD) if rng.uniform() < _ROLLED else 0.0
        slack = 0.5 * (1.0 - 1.0 / zoom)
        centre = (0.5 + rng.uniform(-slack, slack), 0.5 + rng.uniform(-slack, slack))
        warp = _warp((width, height), centre, zoom * SIZE[0] / width, roll)
        if rng.uniform() < 0.5:
            warp = np.diag([-1.0, 1.0, 1.0]) @ warp
            warp[0, 2] += SIZE[0]
        seen = cv2.warpAffine(
            image, _of_pixels(warp), SIZE, flags=cv2.INTER_AREA, borderMode=cv2.BORDER_REPLICATE
        )
        grid = (SIZE[0] // STRIDE, SIZE[1] // STRIDE)
        steps = np.diag([1.0 / STRIDE, 1.0 / STRIDE, 1.0])
        stored = np.diag([width / depth_m.shape[1], height / depth_m.shape[0], 1.0])
        depth = cv2.warpAffine(
            depth_m, _of_pixels(steps @ warp @ stored), grid, flags=cv2.INTER_NEAREST
        )
        focal = float(room["K"][k][0]) * zoom / width
        grey = augmented(np.asarray(seen, np.float32), rng) / np.float32(255.0)
        known = np.asarray(depth, np.float32)
        return DepthView(grey, known, normals_of(known, focal), focal)


def _warp(
    size: tuple[int, int], centre: tuple[float, float], scale: float, roll_rad: float
) -> FloatArray:
    """Homogeneous matrix (3, 3) from a view of ``size`` to one of ``SIZE``, px from the corner."""
    c, s = scale * math.cos(roll_rad), scale * math.sin(roll_rad)
    turn = np.array([[c, -s, 0.0], [s, c, 0.0], [0.0, 0.0, 1.0]])
    turn[:2, 2] = np.array(SIZE) / 2 - turn[:2, :2] @ (np.array(centre) * size)
    return turn


def _of_pixels(warp: FloatArray) -> FloatArray:
    """Matrix (2, 3) between px that are counted from their centres."""
    half = np.array([0.5, 0.5])
    shift = warp[:2, :2] @ half + warp[:2, 2] - half
    return np.column_stack([warp[:2, :2], shift])


def normals_of(depth_m: Float32Array, focal: float) -> Float32Array:
    """Unit normals (60, 80, 3) towards the camera of a depth map (120, 160); 0 at steps."""
    every = NORMALS_STRIDE // STRIDE
    z = np.asarray(depth_m[::every, ::every], np.float64)
    rows, columns = z.shape
    x = (np.arange(columns) + 0.5 - columns / 2) / (columns * focal) * z
    y = ((np.arange(rows) + 0.5 - rows / 2) / (columns * focal))[:, None] * z
    points = np.stack([x, y, z], axis=2)
    right, down = np.gradient(points, axis=1), np.gradient(points, axis=0)
    normal = np.cross(down, right)
    length = np.linalg.norm(normal, axis=2, keepdims=True)
    limit = _SMOOTH * z
    known = (z > 0) & (np.abs(right[..., 2]) < limit) & (np.abs(down[..., 2]) < limit)
    known &= cv2.erode((z > 0).astype(np.uint8), np.ones((3, 3), np.uint8)) > 0
    return np.where(known[..., None], normal / np.maximum(length, 1e-12), 0.0).astype(np.float32)
