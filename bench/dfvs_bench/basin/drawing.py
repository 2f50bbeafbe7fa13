"""Drawing the basin's tasks in the free space of a scene, by seed."""

from __future__ import annotations

import math
import zlib
from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np

from dfvs_bench.basin.cells import Cell
from dfvs_bench.basin.environments import Environment
from dfvs_bench.trials.run import renderer_of
from dfvs_bench.trials.task import BenchTask
from dfvs_bench.trials.task_sampling import SceneSampler
from dfvs_core.geometry.arrays import Float32Array, FloatArray
from dfvs_sim.render.truth import visibility
from dfvs_sim.scene.mesh import SceneError

DRAWING_VERSION = 1
"""To be raised whenever other tasks would be drawn from the same seed."""

LEAST_OVERLAP = 0.2
"""Share of the goal's pixels that the start must see in the tasks with overlap."""

_GOALS, _GOALS_TRIED, _STARTS_TRIED = 12, 1000, 600
_ON_THE_WAY_M, _STEP_M = 0.2, 0.3
_LEAST_DEPTH_M, _LEAST_FEATURES, _JUDGE_WIDTH_PX = 1.3, 50, 320


@dataclass(frozen=True, slots=True)
class DrawnTask:
    """A task of the basin, as it is kept on disk."""

    name: str
    environment: str
    """Name of its scene, as ``name`` is that of the task, unique in a run."""
    cell: Cell
    """How far the start is from the goal."""
    overlap: float
    """Share of the goal's pixels that the start sees, by exact depth."""
    freely: bool
    """Drawn without looking at the overlap: it counts among "all tasks"."""
    start: tuple[float, ...]
    goal: tuple[float, ...]
    """Both are ``T_world_camera`` (4, 4) row by row, NED."""

    @property
    def overlaps(self) -> bool:
        """Whether the start sees enough of the goal to count among the tasks with overlap."""
        return self.overlap >= LEAST_OVERLAP

    def task(self, environment: Environment) -> BenchTask:
        """The task in its scene."""
        T_start, T_goal = np.array([self.start, self.goal]).reshape(2, 4, 4)
        return BenchTask(self.name, environment.scene, T_start, T_goal, environment.camera)


@dataclass(frozen=True, slots=True)
class DrawRequest:
    """What is to be drawn in one environment."""

    environment: Environment
    cells: tuple[Cell, ...]
    count: int
    """Tasks of every cell, drawn freely; and as many with overlap."""
    seed: int
    """Decides, with the names of environment and cell, on everything."""

    def rng(self, *more: int) -> np.random.Generator:
        """Random numbers of this environment, or of one of its cells."""
        return np.random.default_rng([self.seed, zlib.crc32(self.environment.name.encode()), *more])


def draw(request: DrawRequest) -> tuple[DrawnTask, ...]:
    """Draw the tasks of one environment, cell by cell.

    Tasks are drawn one after the other. The first ``count`` of a cell are kept whatever the start
    sees of the goal; of those that follow, only those with overlap, until there are ``count`` of
    these as well. A cell for which the scene is too small has fewer, or none.
    """
    sampler = _Sampler(request.environment, request.rng())
    return tuple(task for cell in request.cells for task in _draw_cell(sampler, cell, request))


def _draw_cell(sampler: _Sampler, cell: Cell, request: DrawRequest) -> list[DrawnTask]:
    tasks: list[DrawnTask] = []
    free = overlapping = 0
    name = request.environment.name
    for T_start, T_goal, overlap in sampler.candidates(cell, request.rng(*cell.seed)):
        freely, overlaps = free < request.count, overlap >= LEAST_OVERLAP
        if freely or overlaps:
            poses = (tuple(T_start.ravel().tolist()), tuple(T_goal.ravel().tolist()))
            task_name = f"{cell.name}-{name}-{len(tasks):02d}"
            tasks.append(DrawnTask(task_name, name, cell, overlap, freely, *poses))
        free, overlapping = free + freely, overlapping + overlaps
        if free >= request.count and overlapping >= request.count:
            break
    return tasks


class _Sampler(SceneSampler):
    """Draws goals and starts in one scene."""

    def __init__(self, environment: Environment, rng: np.random.Generator) -> None:
        super().__init__(renderer_of(environment.scene), environment.camera)
        self._most_empty = environment.most_empty
        self._goals = self._draw_goals(rng)
        if not self._goals:
            raise SceneError(
                f"no goal found in {environment.scene}", "free space, and views with texture"
            )

    def candidates(
        self, cell: Cell, rng: np.random.Generator
    ) -> Iterator[tuple[FloatArray, FloatArray, float]]:
        """Start, goal and overlap of tasks in free space, until none is found any more."""
        for _ in range(_STARTS_TRIED):
            T_goal, depth_m = self._goals[rng.integers(len(self._goals))]
            T_start = T_goal @ cell.displacement(rng)
            if self._is_reachable(T_start[:3, 3], T_goal[:3, 3]):
                depths = (depth_m, self.renderer.depth(self.camera, T_start))
                seen = visibility(self.camera, (T_goal, T_start), depths)
                yield T_start, T_goal, float(seen.mean())

    def _draw_goals(self, rng: np.random.Generator) -> list[tuple[FloatArray, Float32Array]]:
        """Poses with their depth (H, W): upright, some pitch, texture, nothing right in front."""
        goals: list[tuple[FloatArray, Float32Array]] = []
        for _ in range(_GOALS_TRIED):
            if len(goals) == _GOALS:
                break
            T_goal = self.goal(rng)
            if T_goal is not None and self._is_good(T_goal):
                goals.append((T_goal, self.renderer.depth(self.camera, T_goal)))
        return goals

    def _is_good(self, T_goal: FloatArray) -> bool:
        """Tell whether a view has texture and is not right before something."""
        height = round(_JUDGE_WIDTH_PX * self.camera.height / self.camera.width)
        view = self.renderer.render(self.camera.scaled(_JUDGE_WIDTH_PX, height), T_goal)
        if float(np.mean(view.depth_m <= 0)) > self._most_empty:
            return False
        distance_m = np.where(view.depth_m > 0, view.depth_m, np.inf)
        if float(np.median(distance_m)) < _LEAST_DEPTH_M:
            return False
        return self.features(view.image) >= _LEAST_FEATURES

    def _is_reachable(self, start: FloatArray, goal: FloatArray) -> bool:
        """Tell whether a start (3,) is free, and the straight line to the goal as well."""
        if not self.is_free(start):
            return False
        stops = np.linspace(start, goal, math.ceil(np.linalg.norm(goal - start) / _STEP_M) + 1)
        return self.is_free_path(stops[1:-1], _ON_THE_WAY_M)
