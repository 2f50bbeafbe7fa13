"""Drawing a servoing task in a scene: a goal with texture, and a start that sees part of it."""

import math
from dataclasses import dataclass

import cv2
import numpy as np

from dfvs_core.geometry.arrays import FloatArray, ImageArray
from dfvs_core.geometry.camera import CameraModel
from dfvs_core.geometry.poses import make_pose, so3_exp
from dfvs_sim.render.renderer import Renderer, View
from dfvs_sim.render.truth import visibility
from dfvs_sim.viewpoints.free_space import FreeSpace
from dfvs_sim.viewpoints.poses import camera_pose
from dfvs_sim.viewpoints.sampling import floor_of

_GOALS_TRIED, _STARTS_TRIED = 1500, 20
_CLEARANCE_M, _ON_THE_WAY_M = 0.35, 0.22
_HEIGHT_M = (0.6, 2.0)
_DEPTH_M = (1.3, 6.0)
_GOAL_PITCH_RAD = (math.radians(-15.0), math.radians(8.0))
_WAY_POINTS = 8


@dataclass(frozen=True, slots=True)
class TaskConstraints:
    """What a task must be like."""

    distance_m: float
    angle_rad: float
    """Both are between start and goal, exactly."""
    overlap: tuple[float, float]
    """Least and most share of the goal's pixels that the start sees."""
    features: int
    """Least number of SIFT points in each of the two views."""
    most_empty: float = 0.0
    """Share of each view, at most, that may show no surface: scans have holes."""


def draw_task(
    renderer: Renderer, camera: CameraModel, constraints: TaskConstraints, rng: np.random.Generator
) -> tuple[FloatArray, FloatArray] | None:
    """Draw ``T_world_start`` and ``T_world_goal`` (4, 4) with free space between them.

    None where none was found.
    """
    sampler = TaskSampler(renderer, camera, constraints)
    for _ in range(_GOALS_TRIED):
        T_goal = sampler.goal(rng)
        view = None if T_goal is None else sampler.good_view(T_goal)
        if T_goal is None or view is None:
            continue
        for _ in range(_STARTS_TRIED):
            T_start = sampler.start(T_goal, view, rng)
            if T_start is not None:
                return T_start, T_goal
    return None


class SceneSampler:
    """Draws camera poses in the free space of one scene."""

    def __init__(self, renderer: Renderer, camera: CameraModel) -> None:
        self.renderer, self.camera = renderer, camera
        self._space = FreeSpace(renderer)
        self._sift = cv2.SIFT.create(nfeatures=2000)
        floor_m, low, high = floor_of(renderer.scene)
        self._low = np.array([*low, floor_m - _HEIGHT_M[1]])
        self._high = np.array([*high, floor_m - _HEIGHT_M[0]])

    def goal(self, rng: np.random.Generator) -> FloatArray | None:
        """Upright pose (4, 4) with some pitch; None where there is no free space."""
        place = rng.uniform(self._low, self._high)
        yaw, pitch = rng.uniform(-math.pi, math.pi), rng.uniform(*_GOAL_PITCH_RAD)
        if self._space.clearance_m(place) < _CLEARANCE_M:
            return None
        return camera_pose((place[0], place[1], place[2]), yaw, pitch)

    def is_free(self, place: FloatArray) -> bool:
        """Whether a place (3,) lies over the floor, with nothing near."""
        if (place < self._low).any() or (place > self._high).any():
            return False
        return self._space.clearance_m(place) >= _CLEARANCE_M

    def is_free_path(self, places: FloatArray, clearance_m: float) -> bool:
        """Whether nothing is nearer than that to any of the places (N, 3)."""
        return all(self._space.clearance_m(place) >= clearance_m for place in places)

    def features(self, image: ImageArray) -> int:
        """Number of SIFT points of an image (H, W, 3)."""
        return len(self._sift.detect(cv2.cvtColor(image, cv2.COLOR_RGB2GRAY), None))


class TaskSampler(SceneSampler):
    """Draws goals and starts that meet constraints."""

    def __init__(
        self, renderer: Renderer, camera: CameraModel, constraints: TaskConstraints
    ) -> None:
        super().__init__(renderer, camera)
        self._constraints = constraints

    def start(self, T_goal: FloatArray, view: View, rng: np.random.Generator) -> FloatArray | None:
        """Away from the goal by the distance and the angle asked for; None if it will not do."""
        way, axis = rng.normal(size=(2, 3))
        way *= self._constraints.distance_m / np.linalg.norm(way)
        axis *= self._constraints.angle_rad / np.linalg.norm(axis)
        end = T_goal[:3, 3]
        place = end + way
        T_start = make_pose(T_goal[:3, :3] @ so3_exp(axis), place)
        first = self.good_view(T_start) if self.is_free(place) else None
        if first is None:
            return None
        depths = (view.depth_m, first.depth_m)
        overlap = visibility(self.camera, (T_goal, T_start), depths).mean()
        if not self._constraints.overlap[0] <= overlap <= self._constraints.overlap[1]:
            return None
        free = self.is_free_path(np.linspace(place, end, _WAY_POINTS), _ON_THE_WAY_M)
        return T_start if free else None

    def good_view(self, T_world_camera: FloatArray) -> View | None:
        """View from a pose, if it is neither too near nor too far nor too plain."""
        view = self.renderer.render(self.camera, T_world_camera)
        empty = view.depth_m <= 0
        if float(empty.mean()) > self._constraints.most_empty:
            return None
        if not _DEPTH_M[0] <= float(np.median(view.depth_m[~empty])) <= _DEPTH_M[1]:
            return None
        return view if self.features(view.image) >= self._constraints.features else None
