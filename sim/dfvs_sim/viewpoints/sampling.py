"""Flights in a scene, drawn at random."""

from __future__ import annotations

from dataclasses import dataclass

import cv2
import numpy as np

from dfvs_core.geometry.arrays import FloatArray
from dfvs_core.geometry.camera import CameraModel
from dfvs_sim.render.renderer import Renderer, View
from dfvs_sim.render.truth import visibility
from dfvs_sim.scene.mesh import Scene, SceneError
from dfvs_sim.viewpoints.free_space import FreeSpace
from dfvs_sim.viewpoints.poses import camera_pose


@dataclass(frozen=True, slots=True)
class TaskLimits:
    """What a drawn flight must be like. Pairs are (least, most).

    ``height_m`` is above the floor, ``depth_m`` is the median depth of a view, ``clearance_m`` the
    free distance around both poses and the straight line between them, ``overlap`` the share of
    the goal's pixels that the start sees as well, ``features`` SIFT points in 320 px wide views.
    """

    distance_m: tuple[float, float] = (0.8, 1.5)
    yaw_rad: tuple[float, float] = (float(np.radians(20.0)), float(np.radians(30.0)))
    climb_m: tuple[float, float] = (-0.25, 0.25)
    height_m: tuple[float, float] = (0.8, 1.8)
    depth_m: tuple[float, float] = (1.2, 5.0)
    clearance_m: float = 0.4
    overlap: float = 0.5
    features: int = 50


@dataclass(frozen=True, slots=True, eq=False)
class Task:
    """A flight: level camera poses (4, 4) in NED, and the share of the goal seen at the start."""

    T_world_start: FloatArray
    T_world_goal: FloatArray
    overlap: float


_GOALS_TRIED, _STARTS_TRIED = 300, 12
_CHECKED_WIDTH_PX = 320
_LEVEL_STEP_M = 0.05


def sample_task(
    renderer: Renderer,
    camera: CameraModel,
    rng: np.random.Generator,
    limits: TaskLimits | None = None,
) -> Task:
    """Draw a flight in free space between two views that have texture and overlap.

    Raises
    ------
    SceneError
        If none was found: the scene is too small, too crowded or too plain.
    """
    limits = limits or TaskLimits()
    checker = _Checker(renderer, camera, limits)
    floor_m, low, high = floor_of(renderer.scene)
    for _ in range(_GOALS_TRIED):
        north, east = rng.uniform(low, high)
        goal = np.array([north, east, floor_m - rng.uniform(*limits.height_m)])
        yaw = rng.uniform(-np.pi, np.pi)
        if not checker.is_free(goal, floor_m):
            continue
        T_goal = camera_pose((goal[0], goal[1], goal[2]), yaw)
        view = checker.view(T_goal)
        if not checker.is_good(view):
            continue
        for _ in range(_STARTS_TRIED):
            task = _try_start(checker, (T_goal, view), (yaw, floor_m), rng)
            if task is not None:
                return task
    raise SceneError(
        f"no flight of {limits.distance_m[0]:g} to {limits.distance_m[1]:g} m found in the scene",
        f"free airspace with {limits.clearance_m:g} m to everything, and textured views",
        "give --start and --goal, or another --scene",
    )


def _try_start(
    checker: _Checker,
    goal: tuple[FloatArray, View],
    yaw_floor: tuple[float, float],
    rng: np.random.Generator,
) -> Task | None:
    """Draw one start for a goal pose and its view; None if it does not meet the limits."""
    T_goal, view = goal
    yaw, floor_m = yaw_floor
    limits = checker.limits
    end = T_goal[:3, 3]
    step = rng.normal(size=3) * [1.0, 1.0, 0.0]
    step *= rng.uniform(*limits.distance_m) / np.linalg.norm(step)
    step[2] = rng.uniform(*limits.climb_m)
    step *= min(1.0, limits.distance_m[1] / float(np.linalg.norm(step)))
    turn = rng.choice([-1.0, 1.0]) * rng.uniform(*limits.yaw_rad)
    start = end + step
    if not limits.height_m[0] <= floor_m - start[2] <= limits.height_m[1]:
        return None
    T_start = camera_pose((start[0], start[1], start[2]), yaw + turn)
    first = checker.view(T_start)
    seen = visibility(checker.camera, (T_goal, T_start), (view.depth_m, first.depth_m))
    overlap = float(seen.mean())
    if overlap < limits.overlap or not checker.is_good(first):
        return None
    stops = np.linspace(start, end, int(np.ceil(np.linalg.norm(step) / 0.25)) + 1)
    if not all(checker.is_free(stop, floor_m) for stop in stops):
        return None
    return Task(T_start, T_goal, overlap)


class _Checker:
    """Decides about points and views of one scene, from small renderings."""

    def __init__(self, renderer: Renderer, camera: CameraModel, limits: TaskLimits) -> None:
        self._renderer = renderer
        width = min(_CHECKED_WIDTH_PX, camera.width)
        self.camera = camera.scaled(width, max(16, round(width * camera.height / camera.width)))
        self.limits = limits
        self._sift = cv2.SIFT.create(nfeatures=2000)
        self._space = FreeSpace(renderer)

    def view(self, T_world_camera: FloatArray) -> View:
        """Small view from a pose."""
        return self._renderer.render(self.camera, T_world_camera)

    def is_free(self, point: FloatArray, floor_m: float) -> bool:
        """Tell whether nothing is near a point (3,) and the floor is below it."""
        if self._space.clearance_m(point) < self.limits.clearance_m:
            return False
        return 0.0 < self._space.below_m(point) <= float(floor_m - point[2]) + 2 * _LEVEL_STEP_M

    def is_good(self, view: View) -> bool:
        """Tell whether a view is neither too near nor too far, and has texture all over."""
        seen = view.depth_m > 0
        if seen.mean() < 0.95:
            return False
        low, high = self.limits.depth_m
        if not low <= float(np.median(view.depth_m[seen])) <= high:
            return False
        grey = cv2.cvtColor(view.image, cv2.COLOR_RGB2GRAY)
        points = self._sift.detect(grey, None)
        if len(points) < self.limits.features:
            return False
        size = np.array(self.camera.size) / [4, 3]
        cells = {tuple((np.array(p.pt) // size).astype(int)) for p in points}
        return len(cells) >= 8


def floor_of(scene: Scene) -> tuple[float, FloatArray, FloatArray]:
    """Level of a scene's floor (down, m), and the lowest and highest (north, east) of it.

    The floor is the lowest level that has at least half the area of the largest one.

    Raises
    ------
    SceneError
        If nothing in the scene is level.
    """
    corners = scene.vertices[scene.triangles].astype(np.float64)
    normal = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    area = 0.5 * np.linalg.norm(normal, axis=1)
    level = np.abs(normal[:, 2]) > 0.995 * 2.0 * np.maximum(area, 1e-12)
    if not level.any():
        raise SceneError("the scene has no level surface", "a floor to fly above")
    heights = corners[level].mean(axis=1)[:, 2]
    step = np.round(heights / _LEVEL_STEP_M).astype(np.int64)
    steps, index = np.unique(step, return_inverse=True)
    total = np.bincount(index, weights=area[level])
    lowest = steps[total >= 0.5 * total.max()].max()
    on_floor = corners[level][step == lowest].reshape(-1, 3)
    floor_m = float(np.average(heights[step == lowest], weights=area[level][step == lowest]))
    return floor_m, on_floor[:, :2].min(axis=0), on_floor[:, :2].max(axis=0)
