"""Wide-baseline pairs of a room, to train the matcher on: grey views, depth, motion."""

import math
from collections.abc import Iterator
from typing import Any

import cv2
import numpy as np

from dfvs_core.geometry.arrays import Float32Array, FloatArray
from dfvs_core.geometry.camera import CameraModel
from dfvs_core.geometry.poses import invert_pose, make_pose, so3_exp
from dfvs_sim.render.renderer import Renderer
from dfvs_sim.render.truth import visibility
from dfvs_sim.viewpoints.free_space import FreeSpace
from dfvs_sim.viewpoints.poses import camera_pose
from dfvs_sim.viewpoints.sampling import floor_of

SIZE = (640, 480)
"""Of the views, px."""

_JUDGE_SIZE = (80, 60)
_FOV_DEG = (60.0, 90.0)
_HEIGHT_M = (0.6, 2.0)
_CLEARANCE_M = 0.3
_MOST_M, _LEAST_M = 4.0, 0.3
_MOST_ROTATION_DEG = (32.0, 32.0, 55.0)
"""About the camera's x, y and z."""
_LEAST_OVERLAP = 0.12
"""Share of the second view that the first one sees."""
_LEAST_DEPTH_M = (1.2, 0.6)
"""Median depth of the second view and of the first."""
_PLACES_TRIED, _STARTS_TRIED, _PAIRS_A_PLACE = 3000, 25, 4


class WidePairSampler:
    """Draws pairs in one scene; the seed decides on every pair."""

    def __init__(self, renderer: Renderer, seed: int) -> None:
        self._renderer = renderer
        self._space = FreeSpace(renderer)
        self._rng = np.random.default_rng([seed, 7])
        floor_m, low, high = floor_of(renderer.scene)
        self._low = np.array([*low, floor_m - _HEIGHT_M[1]])
        self._high = np.array([*high, floor_m - _HEIGHT_M[0]])

    def arrays(self, count: int) -> dict[str, Any]:
        """At most ``count`` pairs.

        ``a0``, ``b0``, ... are PNG of the views; ``T`` (N, 4, 4) the second camera in the first,
        m; ``K`` (N, 4) fx, fy, cx, cy; ``D`` (N, 2, H / 2, W / 2) depth of both in m, 0 is sky.
        """
        out: dict[str, Any] = {"T": [], "K": [], "D": []}
        for camera, T_first, T_second in self._poses():
            k = len(out["T"])
            if k == count:
                break
            views = [self._renderer.render(camera, T, antialias=True) for T in (T_first, T_second)]
            for side, view in zip("ab", views, strict=True):
                grey = cv2.cvtColor(view.image, cv2.COLOR_RGB2GRAY)
                out[f"{side}{k}"] = cv2.imencode(".png", grey)[1]
            out["T"].append(invert_pose(T_first) @ T_second)
            out["K"].append((camera.fx, camera.fy, camera.cx, camera.cy))
            out["D"].append([view.depth_m[::2, ::2].astype(np.float16) for view in views])
        return {name: np.asarray(value) for name, value in out.items()}

    def _poses(self) -> Iterator[tuple[CameraModel, FloatArray, FloatArray]]:
        """Camera and poses (4, 4) of pairs that see enough of each other."""
        rng = self._rng
        for _ in range(_PLACES_TRIED):
            fov_rad = math.radians(rng.uniform(*_FOV_DEG))
            small = CameraModel.from_horizontal_fov(*_JUDGE_SIZE, fov_rad)
            place = rng.uniform(self._low, self._high)
            if self._space.clearance_m(place) < _CLEARANCE_M:
                continue
            yaw, pitch = rng.uniform(-math.pi, math.pi), math.radians(rng.uniform(-15.0, 8.0))
            T_second = camera_pose((place[0], place[1], place[2]), yaw, pitch)
            depth = self._renderer.depth(small, T_second)
            if _median(depth) < _LEAST_DEPTH_M[0]:
                continue
            camera = CameraModel.from_horizontal_fov(*SIZE, fov_rad)
            for T_first in self._starts(small, T_second, depth):
                yield camera, T_first, T_second

    def _starts(
        self, camera: CameraModel, T_second: FloatArray, depth: Float32Array
    ) -> Iterator[FloatArray]:
        """A few poses (4, 4) that see enough of a view."""
        found = 0
        for _ in range(_STARTS_TRIED):
            T_first = T_second @ self._displacement()
            at = T_first[:3, 3]
            if (at < self._low).any() or (at > self._high).any():
                continue
            seen_depth = self._renderer.depth(camera, T_first)
            if _median(seen_depth) < _LEAST_DEPTH_M[1]:
                continue
            seen = visibility(camera, (T_second, T_first), (depth, seen_depth))
            if seen.mean() < _LEAST_OVERLAP or self._space.clearance_m(at) < _CLEARANCE_M:
                continue
            yield T_first
            found += 1
            if found == _PAIRS_A_PLACE:
                return

    def _displacement(self) -> FloatArray:
        """Motion (4, 4): up to 4 m along an axis, and the rotations of the basin."""
        rng = self._rng
        t = rng.uniform(-1.0, 1.0, 3)
        t *= rng.uniform(_LEAST_M, _MOST_M) / max(float(np.abs(t).max()), 1e-3)
        angles = np.radians(rng.uniform(0.0, _MOST_ROTATION_DEG) * rng.choice([-1.0, 1.0], 3))
        return make_pose(so3_exp(angles), t)


def _median(depth: Float32Array) -> float:
    return float(np.median(np.where(depth > 0, depth, np.inf)))
