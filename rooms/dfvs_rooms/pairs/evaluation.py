"""Pairs of views to evaluate on: places, looks and motions in a room, the flow, and their file.

``dfvs_models.evaluation_file`` tells what is in the file.
"""

import io
import math
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from dfvs_common.atomic_file import replace_file
from dfvs_core.geometry.arrays import BoolArray, Float32Array, FloatArray
from dfvs_core.geometry.poses import make_pose, so3_exp
from dfvs_models.evaluation import LEVELS
from dfvs_models.evaluation_file import EVALUATION_CAMERA
from dfvs_sim.render.renderer import Renderer, View
from dfvs_sim.render.truth import exact_flow, visibility
from dfvs_sim.scene.frames import gltf_pose_from_ned
from dfvs_sim.scene.mesh import SceneError
from dfvs_sim.viewpoints.free_space import FreeSpace
from dfvs_sim.viewpoints.poses import camera_pose
from dfvs_sim.viewpoints.sampling import floor_of

Arrays = dict[str, NDArray[Any]]

_PLACES_TRIED, _MOVES_TRIED = 400, 8
_HIGHEST_M = 4.5
"""Above the floor, m: no camera flies higher, be it in a hall or under the sky."""
_LEVEL_LIMITS = {"small": (0.15, 6.0), "medium": (0.5, 15.0), "large": (1.2, 30.0)}
"""Longest way of the camera's centre, m, and largest turn about each of its axes, degrees."""
_CLEARANCE_M = (0.3, 0.25)
"""Free distance around the first and around the second camera."""
_LEAST_DEPTH_M = 1.1
"""Median depth of the first view."""
_LEAST_OVERLAP = 0.35
"""Share of the first view's pixels that the second sees as well."""


@dataclass(frozen=True, slots=True, eq=False)
class ViewPair:
    """Two views of one scene by ``EVALUATION_CAMERA``."""

    poses: tuple[FloatArray, FloatArray]
    """``T_world_a`` and ``T_world_b``, NED."""
    views: tuple[View, View]
    """Image and depth of each."""
    flow: Float32Array
    """(H, W, 2) float32: px, a to b; NaN where it means nothing."""
    visible: BoolArray
    """(H, W) bool: where a shows what b sees as well."""


class PairSampler:
    """Draws pairs of views of one scene.

    It must have a floor, else SceneError, and be closed enough that no view has much sky.
    """

    def __init__(self, renderer: Renderer) -> None:
        self._renderer = renderer
        self._space = FreeSpace(renderer)
        floor_m, low, high = floor_of(renderer.scene)
        ceiling_m = max(float(renderer.scene.bounds[0][2]), floor_m - _HIGHEST_M)
        self._low = np.array([*low, ceiling_m]) + 0.2
        self._high = np.array([*high, floor_m]) - 0.2
        if (self._low >= self._high).any():
            raise SceneError(f"the scene is only {high - low} m wide", "room for a camera")

    def evaluation_pair(self, level: str, rng: np.random.Generator) -> ViewPair:
        """Draw places, looks and motions of a level until a pair is good to evaluate on.

        Raises
        ------
        SceneError
            If none was found.
        """
        for _ in range(_PLACES_TRIED):
            place = rng.uniform(self._low, self._high)
            if self._space.clearance_m(place) < _CLEARANCE_M[0]:
                continue
            T_world_a = _upright_look(place, rng)
            depth_m = self._renderer.depth(EVALUATION_CAMERA, T_world_a)
            if np.median(depth_m) < _LEAST_DEPTH_M:
                continue
            for _ in range(_MOVES_TRIED):
                pair = self._seen_from((T_world_a, _moved(T_world_a, level, rng)), depth_m)
                if pair is not None:
                    return pair
        raise SceneError(
            f"no pair of views found in {_PLACES_TRIED} places", "a room with free space in it"
        )

    def _seen_from(
        self, poses: tuple[FloatArray, FloatArray], depth_a_m: Float32Array
    ) -> ViewPair | None:
        """Both views and the flow between them; None if they are not good to evaluate on."""
        end = poses[1][:3, 3]
        if (end < self._low).any() or (end > self._high).any():
            return None
        depths = (depth_a_m, self._renderer.depth(EVALUATION_CAMERA, poses[1]))
        visible = visibility(EVALUATION_CAMERA, poses, depths)
        if visible.mean() < _LEAST_OVERLAP or self._space.clearance_m(end) < _CLEARANCE_M[1]:
            return None
        a, b = (self._renderer.render(EVALUATION_CAMERA, pose, antialias=True) for pose in poses)
        flow = exact_flow(EVALUATION_CAMERA, poses[0], depth_a_m, poses[1])
        return ViewPair(poses, (a, b), flow, visible)


def _upright_look(place: FloatArray, rng: np.random.Generator) -> FloatArray:
    """``T_world_camera`` (4, 4) at a place (3,): any heading, 18 degrees down to 12 up."""
    pitch = math.radians(rng.uniform(-18.0, 12.0))
    return camera_pose((place[0], place[1], place[2]), float(rng.uniform(-math.pi, math.pi)), pitch)


def _moved(T_world_a: FloatArray, level: str, rng: np.random.Generator) -> FloatArray:
    """Pose (4, 4) after 0.4 to 1 times a level's way in any direction, and turns of the level."""
    most_m, most_deg = _LEVEL_LIMITS[level]
    turn_rad = rng.uniform(-1.0, 1.0, 3) * math.radians(most_deg)
    distance_m = most_m * float(rng.uniform(0.4, 1.0))
    way = rng.normal(size=3)
    place = T_world_a[:3, 3] + distance_m * way / np.linalg.norm(way)
    return make_pose(T_world_a[:3, :3] @ so3_exp(turn_rad), place)


def evaluation_arrays(pairs: Sequence[ViewPair], levels: Sequence[str]) -> Arrays:
    """Arrays of an evaluation file of pairs and their levels; flow is 0 where it means nothing."""
    limit = np.finfo(np.float16).max
    flow = np.stack([pair.flow for pair in pairs])
    return {
        "IA": np.stack([pair.views[0].image for pair in pairs]),
        "IB": np.stack([pair.views[1].image for pair in pairs]),
        "flow": np.clip(np.nan_to_num(flow, nan=0.0), -limit, limit).astype(np.float16),
        "vis": np.stack([pair.visible for pair in pairs]),
        "depth": np.stack([pair.views[0].depth_m for pair in pairs]).astype(np.float16),
        "TA": np.stack([gltf_pose_from_ned(pair.poses[0]) for pair in pairs]),
        "TB": np.stack([gltf_pose_from_ned(pair.poses[1]) for pair in pairs]),
        "level": np.array([LEVELS.index(level) for level in levels], np.int64),
    }


def write_arrays(path: Path, arrays: Arrays) -> None:
    """Write an ``.npz`` and put it in place whole, so that a reader never sees half of it.

    Raises
    ------
    ConfigError
        If it cannot be written.
    """
    file = io.BytesIO()
    np.savez_compressed(file, allow_pickle=False, **arrays)
    replace_file(path, file.getvalue())
