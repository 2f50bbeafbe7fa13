"""Pairs of views with the pose between them, to train networks that regress it."""

import functools
import math
from typing import NamedTuple, cast

import cv2
import numpy as np

from dfvs_core.geometry.arrays import BoolArray, Float32Array, FloatArray, ImageArray
from dfvs_core.geometry.camera import CameraModel, homogeneous
from dfvs_core.geometry.poses import invert_pose, make_pose, so3_exp
from dfvs_export.networks.pose_regression import SIZE
from dfvs_export.training.room_pairs import RoomReader, augmented, view_of

_RANGE = (0.006, 0.3)
"""Length of a translation over the median depth; small ones are more frequent."""
_ROTATION_RAD = math.radians(12.0)
_TURNED, _TURN_RAD = 0.5, math.radians(8.0)
"""Share of views of rooms that are turned, and by how much at most about each axis."""
_FILLED_PX = 5
_WINDOWED, _WINDOW = 0.5, 0.12
"""Share of pairs that lose their borders, and how much of either side at most."""
_OUTSIDE = 127.5
"""Grey level outside of a view."""
_NEAREST_M = 0.05
STRIDE = 4
"""Of the grid that flow is given on, px."""


class PosePair(NamedTuple):
    """Two views and the motion between them.

    ``first`` and ``second`` (144, 192) are grey, -1 to 1; ``focal`` is their focal length over the
    width. ``T_first_second`` (4, 4) is in depths of the second view; ``flow`` (36, 48, 2) leads
    from the first view to the second, in widths, not a number where it is unknown or leads out of
    it.
    """

    first: Float32Array
    second: Float32Array
    focal: float
    T_first_second: FloatArray
    flow: Float32Array


class _Seen(NamedTuple):
    """Grey view (144, 192) uint8, its depth in m, 0 where unknown, and where there is any view."""

    camera: CameraModel
    grey: ImageArray
    depth_m: FloatArray
    inside: BoolArray


class RoomPoseReader(RoomReader):
    """Draws pairs of near views of rooms, as along a trajectory; one is made from the other one.

    The depth in ``T_first_second`` is the second view's median. Both views of a pair are cut to the
    same symmetrical area, so that borders do not give the motion away.
    """

    def draw(self) -> PosePair:
        """Draw the next pair."""
        rng = self._rng
        seen = self._seen()
        T = self._motion(seen)
        pair = seen, _moved(seen, T)
        if rng.uniform() < 0.5:
            pair, T = pair[::-1], invert_pose(T)
        area = _common_area(pair[0].inside & pair[1].inside, rng)
        first, second = (_augmented_within(view.grey, area, rng) for view in pair)
        camera = pair[0].camera
        flow = _flow(camera, pair[0].depth_m, T)
        in_depths = make_pose(T[:3, :3], T[:3, 3] / _median_depth_m(pair[1]))
        return PosePair(first, second, camera.fx / camera.width, in_depths, flow)

    def _seen(self) -> _Seen:
        """A view of a room, perhaps turned."""
        rng = self._rng
        room, k = self._draw_pair()
        side = int(rng.integers(2))
        image = view_of(room, k, "ab"[side])
        depth_m = room["D"][k][side].astype(np.float64)
        fx, fy, cx, cy = (float(v) for v in room["K"][k] * SIZE[0] / image.shape[1])
        camera = CameraModel(*SIZE, fx, fy, cx, cy)
        small = cast(ImageArray, cv2.resize(image, SIZE, interpolation=cv2.INTER_AREA))
        R = so3_exp(rng.uniform(-_TURN_RAD, _TURN_RAD, 3) * (rng.uniform() < _TURNED))
        directions = rays(camera) @ R.T
        pixels = camera.project(directions)
        known, inside = _looked_up(depth_m, pixels, camera)
        return _Seen(camera, _sampled(small, pixels), known / directions[..., 2], inside)

    def _motion(self, seen: _Seen) -> FloatArray:
        """Motion (4, 4) in m that is small against the depth of a view."""
        rng = self._rng
        length_m = _median_depth_m(seen) * math.exp(rng.uniform(*np.log(_RANGE)))
        way = rng.normal(size=3)
        turn = rng.uniform() * rng.uniform(-_ROTATION_RAD, _ROTATION_RAD, 3)
        return make_pose(so3_exp(turn), length_m * way / float(np.linalg.norm(way)))


def _median_depth_m(seen: _Seen) -> float:
    known = seen.depth_m[seen.depth_m > 0]
    return float(np.median(known)) if len(known) else 1.0


@functools.lru_cache(maxsize=8)
def rays(camera: CameraModel) -> FloatArray:
    """Points (H, W, 3) at depth 1 that the pixels of a camera look at, in its optical frame."""
    return homogeneous(camera.normalise(camera.grid()))


def _sampled(grey: ImageArray, pixels: FloatArray) -> ImageArray:
    """Grey levels at pixels (h, w, 2)."""
    u, v = np.moveaxis((pixels - 0.5).astype(np.float32), 2, 0)
    return cast(ImageArray, cv2.remap(grey, u, v, cv2.INTER_LINEAR))


def _looked_up(
    depth_m: FloatArray, pixels: FloatArray, camera: CameraModel
) -> tuple[FloatArray, BoolArray]:
    """Depth (h, w) at pixels (h, w, 2) of a camera, 0 outside, and whether they are inside."""
    inside: BoolArray = np.all((pixels >= 0) & (pixels < camera.size), axis=2)
    steps = np.array(depth_m.shape[::-1]) / camera.size
    u, v = np.moveaxis(np.where(inside[..., None], pixels * steps, 0).astype(np.intp), 2, 0)
    return np.where(inside, depth_m[v, u], 0.0), inside


def _moved(seen: _Seen, T_seen_new: FloatArray) -> _Seen:
    """View from another place near by: its depth is splatted, its grey looked up by that."""
    R, t = T_seen_new[:3, :3], T_seen_new[:3, 3]
    camera, directions = seen.camera, rays(seen.camera)
    known = seen.depth_m > 0
    P = (directions[known] * seen.depth_m[known][:, None] - t) @ R
    P = P[P[:, 2] > _NEAREST_M]
    at = camera.project(P)
    within = ((at >= 0) & (at < camera.size)).all(axis=1)
    u, v = at[within].astype(np.intp).T
    z = np.full(seen.depth_m.shape, np.inf)
    np.minimum.at(z, (v, u), P[within, 2])
    z[np.isinf(z)] = 0.0
    behind = cv2.dilate(z, np.ones((_FILLED_PX, _FILLED_PX)))
    z = np.where(z > 0, z, behind)
    Q = directions * z[..., None] @ R.T + t
    Q[..., 2] = np.maximum(Q[..., 2], 1e-6)
    pixels = camera.project(Q)
    source, _ = _looked_up(seen.inside.astype(np.float64), pixels, camera)
    inside = (source > 0) & (z > 0)
    return _Seen(camera, _sampled(seen.grey, pixels), np.where(inside, z, 0.0), inside)


def _flow(camera: CameraModel, depth_m: FloatArray, T_first_second: FloatArray) -> Float32Array:
    """Flow (36, 48, 2) from a view with this depth (144, 192) to another one, in widths."""
    grid = slice(STRIDE // 2, None, STRIDE)
    z = depth_m[grid, grid]
    P = rays(camera)[grid, grid] * z[..., None]
    Q = (P - T_first_second[:3, 3]) @ T_first_second[:3, :3]
    Q[(z <= 0) | (Q[..., 2] < _NEAREST_M)] = np.nan
    return flow_to(camera, camera.project(Q))


def flow_to(camera: CameraModel, there: FloatArray) -> Float32Array:
    """Flow (36, 48, 2) in widths to pixels of another view; not a number to outside of it."""
    inside = ((there >= 0) & (there < camera.size)).all(axis=2, keepdims=True)
    flow = (there - camera.grid(STRIDE)) / camera.width
    return np.where(inside, flow, np.nan).astype(np.float32)


def _common_area(inside: BoolArray, rng: np.random.Generator) -> BoolArray:
    """What is inside of a view and of its mirror images, perhaps without its borders."""
    area = inside & inside[::-1] & inside[:, ::-1] & inside[::-1, ::-1]
    if rng.uniform() < _WINDOWED:
        rows, columns = (round(rng.uniform(0.0, _WINDOW) * n) for n in area.shape)
        middle = np.zeros_like(area)
        middle[rows : area.shape[0] - rows, columns : area.shape[1] - columns] = True
        area &= middle
    return area


def _augmented_within(grey: ImageArray, area: BoolArray, rng: np.random.Generator) -> Float32Array:
    """View (144, 192) from -1 to 1 with another exposure and noise, grey outside of an area."""
    return normalised(np.where(area, augmented(grey.astype(np.float32), rng), _OUTSIDE))


def normalised(grey: FloatArray | Float32Array) -> Float32Array:
    """Grey levels from -1 to 1, of those from 0 to 255."""
    return np.asarray(grey, np.float32) / np.float32(127.5) - np.float32(1.0)
