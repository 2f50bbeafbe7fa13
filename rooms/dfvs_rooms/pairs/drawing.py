"""Drawing pairs of views in a room: places, looks, motions, and the flow between them."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from dfvs_core.geometry.arrays import BoolArray, Float32Array, FloatArray
from dfvs_core.geometry.camera import CameraModel
from dfvs_core.geometry.poses import make_pose, so3_exp
from dfvs_models.evaluation_file import EVALUATION_CAMERA
from dfvs_rooms.pairs.motion import Motion, evaluation_motion
from dfvs_sim.render.renderer import Renderer, View
from dfvs_sim.render.truth import exact_flow, visibility
from dfvs_sim.scene.mesh import SceneError
from dfvs_sim.viewpoints.free_space import FreeSpace
from dfvs_sim.viewpoints.poses import camera_pose
from dfvs_sim.viewpoints.sampling import floor_of

_PLACES_TRIED, _MOVES_TRIED = 400, 8
_HIGHEST_M = 4.5
"""Above the floor, m: no camera flies higher, be it in a hall or under the sky."""


@dataclass(frozen=True, slots=True)
class Rules:
    """What a pair must be like.

    Parameters
    ----------
    clearance_m : tuple of float
        Free distance around the first and around the second camera, m.
    least_depth_m : float
        Least median depth of the first view, m.
    least_overlap : float
        Least share of the first view's pixels that the second sees as well.
    """

    clearance_m: tuple[float, float]
    least_depth_m: float
    least_overlap: float


EVALUATION_RULES = Rules((0.3, 0.25), 1.1, 0.35)


@dataclass(frozen=True, slots=True, eq=False)
class ViewPair:
    """Two views of one scene.

    Parameters
    ----------
    camera : CameraModel
        Intrinsics of both.
    poses : tuple of (4, 4)
        ``T_world_a`` and ``T_world_b``, NED.
    views : tuple of View
        Image and depth of each.
    flows : tuple of (H, W, 2) float32
        px, a to b and b to a; NaN where it means nothing.
    visible : tuple of (H, W) bool
        Seen in both.
    """

    camera: CameraModel
    poses: tuple[FloatArray, FloatArray]
    views: tuple[View, View]
    flows: tuple[Float32Array, Float32Array]
    visible: tuple[BoolArray, BoolArray]


class PairSampler:
    """Draws pairs of views of one scene.

    Parameters
    ----------
    renderer : Renderer
        The scene; it must have a floor and be closed enough that no view has much sky.

    Raises
    ------
    SceneError
        If the scene has no floor.
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
        """Draw an evaluation pair of a level: the first view upright, pitched by a little.

        Raises
        ------
        SceneError
            If none was found.
        """

        def motion(rng: np.random.Generator, _depth_m: float) -> Motion:
            return evaluation_motion(rng, level)

        return self._pair(EVALUATION_CAMERA, EVALUATION_RULES, (_upright_look, motion), rng)

    def _pair(
        self, camera: CameraModel, rules: Rules, draw: tuple[_Look, _Move], rng: np.random.Generator
    ) -> ViewPair:
        """Draw places, looks and motions until a pair follows the rules."""
        look, motion = draw
        for _ in range(_PLACES_TRIED):
            place = rng.uniform(self._low, self._high)
            if self._space.clearance_m(place) < rules.clearance_m[0]:
                continue
            T_world_a = look(place, 0.5 * (self._low + self._high) - place, rng)
            depth_m = self._renderer.depth(camera, T_world_a)
            if np.median(depth_m) < rules.least_depth_m:
                continue
            for _ in range(_MOVES_TRIED):
                T_world_b = _moved(T_world_a, motion(rng, float(np.median(depth_m))), rng)
                pair = self._seen_from(camera, (T_world_a, T_world_b), depth_m, rules)
                if pair is not None:
                    return pair
        raise SceneError(
            f"no pair of views found in {_PLACES_TRIED} places", "a room with free space in it"
        )

    def _seen_from(
        self,
        camera: CameraModel,
        poses: tuple[FloatArray, FloatArray],
        depth_a_m: Float32Array,
        rules: Rules,
    ) -> ViewPair | None:
        """Both views and the flow between them; None if they break the rules."""
        end = poses[1][:3, 3]
        if (end < self._low).any() or (end > self._high).any():
            return None
        depths = (depth_a_m, self._renderer.depth(camera, poses[1]))
        visible_a = visibility(camera, poses, depths)
        if visible_a.mean() < rules.least_overlap:
            return None
        if self._space.clearance_m(end) < rules.clearance_m[1]:
            return None
        views = tuple(self._renderer.render(camera, pose, antialias=True) for pose in poses)
        backwards = poses[::-1]
        return ViewPair(
            camera,
            poses,
            (views[0], views[1]),
            (
                exact_flow(camera, poses[0], depths[0], poses[1]),
                exact_flow(camera, poses[1], depths[1], poses[0]),
            ),
            (visible_a, visibility(camera, backwards, depths[::-1])),
        )


_Look = Callable[[FloatArray, FloatArray, np.random.Generator], FloatArray]
"""``T_world_camera`` (4, 4) of a camera at a place (3,), the room's middle (3,) away from it."""
_Move = Callable[[np.random.Generator, float], Motion]
"""Motion from a view of a median depth, m."""


def _upright_look(
    place: FloatArray, _to_middle: FloatArray, rng: np.random.Generator
) -> FloatArray:
    """Any heading, pitched between 18 degrees down and 12 degrees up."""
    pitch = math.radians(rng.uniform(-18.0, 12.0))
    return camera_pose((place[0], place[1], place[2]), float(rng.uniform(-math.pi, math.pi)), pitch)


def _moved(T_world_a: FloatArray, motion: Motion, rng: np.random.Generator) -> FloatArray:
    """Pose (4, 4) after a motion in a drawn direction."""
    way = rng.normal(size=3)
    place = T_world_a[:3, 3] + motion.distance_m * way / np.linalg.norm(way)
    return make_pose(T_world_a[:3, :3] @ so3_exp(motion.turn_rad), place)
