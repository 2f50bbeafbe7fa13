"""Relocalisation: a single pair of wide baseline, judged by the pose that follows with true depth.

What is measured is the matcher alone: neither the depth estimate nor anything that was seen before
helps it.
"""

import time
from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass, replace
from enum import StrEnum
from typing import Any

import numpy as np

from dfvs_bench.basin.drawing import DrawnTask, DrawRequest, draw
from dfvs_bench.basin.environments import Environment
from dfvs_bench.methods.pnp import pose_with_depth
from dfvs_bench.relocalisation.near_goal import Approach, approach, approach_figures
from dfvs_bench.trials.run import renderer_of
from dfvs_core.errors import ConfigError
from dfvs_core.geometry.arrays import Float32Array, FloatArray
from dfvs_core.geometry.camera import CameraModel
from dfvs_core.geometry.poses import invert_pose, pose_error
from dfvs_core.matching.config import MatchingConfig
from dfvs_core.matching.correspondence import FlowField
from dfvs_models.catalog import load_matcher

RIGHT_DISTANCE, RIGHT_RAD = 0.15, float(np.radians(5.0))
"""Error of the position, in parts of the distance, and of the rotation, that a right pose has."""

_OVERLAPS = (0.2, 0.3, 0.45, 0.6, 1.0)
"""Bounds of the classes by overlap."""

STAGES: dict[str, dict[str, Any]] = {
    "turns": {"turns_rad": (0.0,)},
    "scales": {"scales": (1.0,)},
    "hypotheses": {"most_hypotheses": 1},
    "growing": {"growing_rounds": 0},
    "verification": {"least_explained_ratio": 0.0, "least_confident_ratio": 0.0},
}
"""Stages of relocalisation that can be left out, and the numbers that do so."""


class Verdict(StrEnum):
    """What a match amounts to."""

    RIGHT = "right"
    WRONG = "wrong"
    NONE = "none"


@dataclass(frozen=True, slots=True)
class Relocalisation:
    """One match: of which matcher and task, its verdict, and its time in ms.

    ``approach`` is the last part of the way to the same goal.
    """

    matcher: str
    task: DrawnTask
    verdict: Verdict
    match_ms: float
    approach: Approach


@dataclass(frozen=True, slots=True)
class RelocalisationJob:
    """Tasks of one environment, for one matcher; picklable.

    ``name`` is what the figures are listed by.
    """

    name: str
    matcher: str
    environment: Environment
    tasks: tuple[DrawnTask, ...]
    threads: int
    config: MatchingConfig


def without(stages: Iterable[str]) -> MatchingConfig:
    """Default numbers, with some of :data:`STAGES` left out.

    Raises
    ------
    ConfigError
        If there is no such stage.
    """
    config = MatchingConfig()
    for stage in stages:
        if stage not in STAGES:
            raise ConfigError(f"there is no stage {stage!r}", f"one of {', '.join(STAGES)}")
        config = replace(config, **STAGES[stage])
    return config


def draw_starts(request: DrawRequest, trials: int) -> tuple[DrawnTask, ...]:
    """Starts of one environment that see enough of the goal, at most so many, of all cells."""
    by_cell: dict[str, list[DrawnTask]] = {}
    for task in draw(request):
        if task.overlaps:
            by_cell.setdefault(task.cell.name, []).append(task)
    chosen: list[DrawnTask] = []
    while len(chosen) < trials and any(by_cell.values()):
        chosen += [tasks.pop(0) for tasks in by_cell.values() if tasks]
    return tuple(chosen[:trials])


def relocalise(job: RelocalisationJob) -> list[Relocalisation]:
    """Match every start of a job with its goal.

    The goal is prepared once, as the service does: it is matched with itself first. Preparing the
    current image counts. The first start is matched once more beforehand: what a network sets up at
    its first call does not count.

    Raises
    ------
    DfvsError
        If the scene or the matcher cannot be used.
    """
    matcher = load_matcher(job.matcher, job.threads, config=job.config)
    renderer, camera = renderer_of(job.environment.scene), job.environment.camera
    found: list[Relocalisation] = []
    for k, drawn in enumerate((job.tasks[0], *job.tasks) if job.tasks else ()):
        task = drawn.task(job.environment)
        goal = matcher.encode(renderer.render(camera, task.T_world_goal, antialias=True).image)
        matcher.match(goal, goal)
        view = renderer.render(camera, task.T_world_start, antialias=True)
        began = time.perf_counter()
        flow = matcher.match(matcher.encode(view.image), goal)
        match_ms = 1e3 * (time.perf_counter() - began)
        if k > 0:
            T_true = invert_pose(task.T_world_start) @ task.T_world_goal
            verdict = judge(flow, view.depth_m, camera, T_true)
            last = approach(matcher, job.environment, drawn, camera)
            found.append(Relocalisation(job.name, drawn, verdict, match_ms, last))
    return found


def judge(
    flow: FlowField, depth_m: Float32Array, camera: CameraModel, T_current_goal: FloatArray
) -> Verdict:
    """Verdict on the flow from the current view, of known depth (H, W), to the goal.

    NONE is where :func:`pose_with_depth` gives no pose; ``T_current_goal`` (4, 4) is the true one.
    """
    pose = pose_with_depth(flow, depth_m, camera)
    if pose is None:
        return Verdict.NONE
    error_m, error_rad = pose_error(pose, T_current_goal)
    distance_m = float(np.linalg.norm(T_current_goal[:3, 3]))
    is_right = error_m <= RIGHT_DISTANCE * distance_m and error_rad <= RIGHT_RAD
    return Verdict.RIGHT if is_right else Verdict.WRONG


def summarise(found: Sequence[Relocalisation]) -> dict[str, Any]:
    """Figures of each matcher, also by translation, rotation and overlap of the starts."""
    names = dict.fromkeys(r.matcher for r in found)
    return {name: _figures([r for r in found if r.matcher == name]) for name in names}


def _figures(found: Sequence[Relocalisation]) -> dict[str, Any]:
    ms = np.array([r.match_ms for r in found])
    times = {
        "mean_ms": round(float(ms.mean()), 1),
        "p95_ms": round(float(np.percentile(ms, 95)), 1),
        "max_ms": round(float(ms.max()), 1),
    }
    classes: dict[str, Callable[[DrawnTask], str]] = {
        "by_translation": lambda task: f"{task.cell.translation_m:g} m",
        "by_rotation": lambda task: "/".join(f"{a:g}" for a in task.cell.rotation_deg),
        "by_overlap": _overlap_class,
    }
    return (
        _counts(found)
        | times
        | approach_figures([r.approach for r in found])
        | {
            name: {label: _counts(part) for label, part in _split(found, by)}
            for name, by in classes.items()
        }
    )


def _counts(found: Iterable[Relocalisation]) -> dict[str, int]:
    verdicts = [r.verdict for r in found]
    return {"pairs": len(verdicts)} | {str(v): verdicts.count(v) for v in Verdict}


def _split(
    found: Sequence[Relocalisation], by: Callable[[DrawnTask], str]
) -> list[tuple[str, list[Relocalisation]]]:
    parts: dict[str, list[Relocalisation]] = {}
    for r in found:
        parts.setdefault(by(r.task), []).append(r)
    return sorted(parts.items())


def _overlap_class(task: DrawnTask) -> str:
    upper = next(bound for bound in _OVERLAPS[1:] if task.overlap <= bound)
    return f"{_OVERLAPS[_OVERLAPS.index(upper) - 1]:.0%} to {upper:.0%}"
