"""Tracked frames on the last part of the way to a goal: their time, and the final precision."""

import time
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from dfvs_bench.basin.drawing import DrawnTask
from dfvs_bench.basin.environments import Environment
from dfvs_bench.methods.pnp import pose_with_depth
from dfvs_bench.trials.run import renderer_of
from dfvs_core.geometry.camera import CameraModel
from dfvs_core.geometry.poses import invert_pose, make_pose, pose_error, so3_exp
from dfvs_core.matching.matcher import Matcher, track_or_match
from dfvs_sim.camera.sensor import SensorNoise

_AWAY = (0.04, 0.02, 0.01, 0.005)
"""Distance of each view from the goal over the depth of the goal view; the last is judged."""
_TURN_RAD = 1.0
"""Rotation of a view over that distance."""
_NOISE = 1.5
"""Noise of the camera, grey levels."""


@dataclass(frozen=True, slots=True)
class Approach:
    """The last part of the way to a goal.

    ``tracked_ms`` holds the time of each tracked frame, its preparation included. ``error`` is the
    error of the last pose over the depth of the goal view, ``error_rad`` that of its rotation; None
    where there is no pose.
    """

    tracked_ms: tuple[float, ...]
    error: float | None
    error_rad: float | None


def approach(
    matcher: Matcher, environment: Environment, drawn: DrawnTask, camera: CameraModel
) -> Approach:
    """Track the views that lead to a drawn goal, each by the flow of the one before."""
    renderer = renderer_of(environment.scene)
    rng = np.random.default_rng(int(1e6 * drawn.overlap))
    T_world_goal = drawn.task(environment).T_world_goal
    noise = SensorNoise.make(camera.size, _NOISE, rng)
    view = renderer.render(camera, T_world_goal, antialias=True)
    depth_m = float(np.median(view.depth_m[view.depth_m > 0.0]))
    goal = matcher.encode(noise.apply(view.image, rng))
    aside, turn = (v / np.linalg.norm(v) for v in rng.normal(size=(2, 3)))
    flow, times_ms, pose = None, [], None
    for away in _AWAY:
        T_goal_view = make_pose(so3_exp(turn * away * _TURN_RAD), aside * away * depth_m)
        view = renderer.render(camera, T_world_goal @ T_goal_view, antialias=True)
        image = noise.apply(view.image, rng)
        began = time.perf_counter()
        flow = track_or_match(matcher, matcher.encode(image), goal, flow)
        times_ms.append(1e3 * (time.perf_counter() - began))
        pose = pose_with_depth(flow, view.depth_m, camera)
    if pose is None:
        return Approach(tuple(times_ms[1:]), None, None)
    error_m, error_rad = pose_error(pose, invert_pose(T_goal_view))
    return Approach(tuple(times_ms[1:]), error_m / depth_m, error_rad)


def approach_figures(found: Sequence[Approach]) -> dict[str, Any]:
    """Median time of a tracked frame, and median errors; None where nothing is known."""
    poses = [(a.error, a.error_rad) for a in found if a.error is not None]
    times_ms = [t for a in found for t in a.tracked_ms]
    error, error_rad = np.median(np.array(poses, np.float64), axis=0) if poses else (None, None)
    return {
        "tracked_p50_ms": round(float(np.median(times_ms)), 2),
        "final_error": None if error is None else round(float(error), 6),
        "final_error_deg": None if error_rad is None else round(float(np.degrees(error_rad)), 4),
        "final_none": len(found) - len(poses),
    }
