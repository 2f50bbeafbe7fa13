"""Flying a task through the real service."""

import math
from collections.abc import Sequence
from dataclasses import replace
from importlib.metadata import version
from pathlib import Path
from typing import Any

from dfvs_bench.drone.bound import straight_line_bound
from dfvs_bench.drone.levelled import turn_rad
from dfvs_bench.drone.records import FlightRecord, Setting
from dfvs_bench.trials.provenance import input_digest
from dfvs_bench.trials.run import renderer_of
from dfvs_bench.trials.statistics import settled_index
from dfvs_bench.trials.task import BenchTask
from dfvs_core.gate.limits import VelocityLimits
from dfvs_core.geometry.arrays import FloatArray
from dfvs_core.geometry.poses import pose_error
from dfvs_core.messages.goal import Mount
from dfvs_sim.demo.flight.flight import FLIGHT_ERRORS, Flight
from dfvs_sim.demo.flight.track import TrackPoint, meets_criterion
from dfvs_sim.demo.plan import FlightPlan
from dfvs_sim.demo.progress import Progress
from dfvs_sim.demo.results.summary import NOT_READY, write_results
from dfvs_sim.render.truth import visibility

_FIGURES = ("converged", "final_translation_m", "final_rotation_deg", "path_ratio")
"""Taken as they are from the flight's summary."""


def fly(task: BenchTask, setting: Setting, folder: Path, progress: Progress) -> FlightRecord:
    """Fly a levelled task; its summary and logs go into the folder.

    Where vehicle, pilot or service cannot be brought up, the record says so.

    Raises
    ------
    ConfigError
        If no flight can be brought up with these settings.
    """
    folder.mkdir(parents=True, exist_ok=True)
    poses = (task.T_world_start, task.T_world_goal)
    plan = FlightPlan(renderer_of(task.scene), task.camera, Mount(), *poses, setting.seed)
    flight = Flight(plan, setting.options, folder, lambda text: progress.log(f"  {text}"))
    try:
        log = flight.run(progress.show)
    except FLIGHT_ERRORS as error:
        return _record(task, setting, NOT_READY, str(error))
    figures = write_results(log, folder).to_json()
    T_world_start = log.flown[0].T_scene_camera if log.flown else task.T_world_start
    return replace(
        _record(task, setting, log.end_state, log.end_cause),
        **_initial(T_world_start, task.T_world_goal, setting.limits),
        servo_s=since(log.watch.states, "SERVO", log.engaged_ns),
        within_s=within_s(log.judged, log.engaged_ns),
        done_s=figures["duration_s"],
        **{name: figures[name] for name in _FIGURES},
    )


def since(states: Sequence[tuple[int, str]], wanted: str, start_ns: int) -> float | None:
    """Seconds from a time until a state is first entered after it, or None."""
    times_ns = [t_ns for t_ns, state in states if state == wanted and t_ns >= start_ns]
    return (times_ns[0] - start_ns) * 1e-9 if times_ns else None


def within_s(points: Sequence[TrackPoint], start_ns: int) -> float | None:
    """Seconds from a time until the error stays within 5 cm and 1 degree, or None."""
    first = settled_index([meets_criterion(p.error_m, p.error_rad) for p in points])
    return None if first is None else (points[first].t_ns - start_ns) * 1e-9


def _record(task: BenchTask, setting: Setting, end_state: str, end_cause: str) -> FlightRecord:
    """Record of a flight whose figures are not known."""
    return FlightRecord(
        task=task.name,
        difficulty=task.difficulty,
        matcher=setting.matcher,
        service=setting.service,
        seed=setting.seed,
        start=tuple(task.T_world_start.ravel().tolist()),
        goal=tuple(task.T_world_goal.ravel().tolist()),
        size=task.camera.size,
        overlap=_overlap(task),
        limits=setting.limits,
        **_initial(task.T_world_start, task.T_world_goal, setting.limits),
        end_state=end_state,
        end_cause=end_cause,
        version=version("dfvs"),
        revision=setting.revision,
        timeout_s=setting.options.timeout_s,
        inputs=input_digest(task, setting.matcher, setting.config, setting.network),
        estimate=setting.options.estimate,
        wind=setting.options.wind,
        autopilot=setting.options.autopilot,
    )


def _initial(
    T_world_start: FloatArray, T_world_goal: FloatArray, limits: VelocityLimits
) -> dict[str, Any]:
    """What a record has of the start: the bound, and the errors."""
    way_m = T_world_goal[:3, 3] - T_world_start[:3, 3]
    distance_m, angle_rad = pose_error(T_world_start, T_world_goal)
    return {
        "bound": straight_line_bound(way_m, turn_rad(T_world_start, T_world_goal), limits),
        "initial_translation_m": distance_m,
        "initial_rotation_deg": math.degrees(angle_rad),
    }


def _overlap(task: BenchTask) -> float:
    renderer = renderer_of(task.scene)
    poses = (task.T_world_goal, task.T_world_start)
    depths = tuple(renderer.depth(task.camera, T) for T in poses)
    return float(visibility(task.camera, poses, (depths[0], depths[1])).mean())
