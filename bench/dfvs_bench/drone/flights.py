"""Flying a task through the real service."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from importlib.metadata import version
from pathlib import Path

from dfvs_bench.drone.bound import straight_line_bound
from dfvs_bench.drone.levelled import turn_rad
from dfvs_bench.drone.records import NOT_READY, FlightRecord, Setting
from dfvs_bench.trials.inputs import input_digest
from dfvs_bench.trials.run import renderer_of
from dfvs_bench.trials.task import BenchTask
from dfvs_core.messages.goal import Mount
from dfvs_sim.demo.flight.flight import Flight, NotReadyError
from dfvs_sim.demo.flight.track import TrackPoint
from dfvs_sim.demo.options import FlightOptions
from dfvs_sim.demo.plan import FlightPlan
from dfvs_sim.demo.progress import Progress
from dfvs_sim.demo.results.summary import CONVERGED_DEG, CONVERGED_M, FlightSummary, write_results
from dfvs_sim.render.truth import visibility


@dataclass(frozen=True, slots=True)
class Times:
    """Seconds from the pilot's switch to the first motion, and to the criterion for good."""

    servo_s: float | None = None
    within_s: float | None = None


@dataclass(frozen=True, slots=True)
class End:
    """How a flight ended: the gate's state and cause, and figures where it was flown."""

    state: str
    cause: str
    summary: FlightSummary | None = None
    times: Times = Times()


def fly(task: BenchTask, setting: Setting, folder: Path, progress: Progress) -> FlightRecord:
    """Fly a levelled task; its summary and logs go into the folder.

    Raises
    ------
    DfvsError
        If vehicle, pilot or service cannot be brought up.
    """
    folder.mkdir(parents=True, exist_ok=True)
    poses = (task.T_world_start, task.T_world_goal)
    plan = FlightPlan(renderer_of(task.scene), task.camera, Mount(), *poses, setting.seed)
    options = FlightOptions(
        timeout_s=setting.timeout_s,
        ready_s=setting.ready_s,
        service=setting.words,
        conditions=setting.conditions,
    )
    flight = Flight(plan, options, folder, lambda text: progress.log(f"  {text}"))
    try:
        log = flight.run(progress.show)
    except NotReadyError as error:
        return _record(task, setting, End(NOT_READY, str(error)))
    summary = write_results(log, folder)
    settled = [p for p in log.track.points if p.t_ns >= log.engaged_ns]
    times = Times(
        since(log.watch.states, "SERVO", log.engaged_ns), within_s(settled, log.engaged_ns)
    )
    return _record(task, setting, End(log.end_state, log.end_cause, summary, times))


def since(states: Sequence[tuple[int, str]], wanted: str, start_ns: int) -> float | None:
    """Seconds from a time until a state is first entered after it, or None."""
    times_ns = [t_ns for t_ns, state in states if state == wanted and t_ns >= start_ns]
    return (times_ns[0] - start_ns) * 1e-9 if times_ns else None


def within_s(points: Sequence[TrackPoint], start_ns: int) -> float | None:
    """Seconds from a time until the error stays within 5 cm and 1 degree, or None."""
    limit_rad = math.radians(CONVERGED_DEG)
    outside = [
        k for k, p in enumerate(points) if p.error_m >= CONVERGED_M or p.error_rad >= limit_rad
    ]
    first_inside = outside[-1] + 1 if outside else 0
    if first_inside >= len(points):
        return None
    return (points[first_inside].t_ns - start_ns) * 1e-9


def _record(task: BenchTask, setting: Setting, end: End) -> FlightRecord:
    summary = end.summary
    way_m = task.T_world_goal[:3, 3] - task.T_world_start[:3, 3]
    distance_m, angle_rad = task.initial_error
    return FlightRecord(
        task=task.name,
        difficulty=task.difficulty,
        matcher=setting.matcher,
        service=setting.service,
        seed=setting.seed,
        start=tuple(float(v) for v in task.T_world_start.ravel()),
        goal=tuple(float(v) for v in task.T_world_goal.ravel()),
        size=task.camera.size,
        overlap=_overlap(task),
        limits=setting.limits,
        bound=straight_line_bound(way_m, turn_rad(task), setting.limits),
        initial_translation_m=distance_m,
        initial_rotation_deg=math.degrees(angle_rad),
        end_state=end.state,
        end_cause=end.cause,
        converged=summary is not None and summary.converged,
        final_translation_m=_finite(summary.final_translation_m if summary else None),
        final_rotation_deg=_finite(summary.final_rotation_deg if summary else None),
        servo_s=end.times.servo_s,
        within_s=end.times.within_s,
        done_s=_finite(summary.duration_s if summary else None),
        path_ratio=_finite(summary.path_ratio if summary else None),
        version=version("dfvs"),
        revision=setting.revision,
        timeout_s=setting.timeout_s,
        inputs=input_digest(task, setting.matcher, setting.config),
        estimate=setting.conditions.estimate,
        wind=setting.conditions.wind,
    )


def _finite(value: float | None) -> float | None:
    return value if value is not None and math.isfinite(value) else None


def _overlap(task: BenchTask) -> float:
    renderer = renderer_of(task.scene)
    poses = (task.T_world_goal, task.T_world_start)
    depths = tuple(renderer.depth(task.camera, T) for T in poses)
    return float(visibility(task.camera, poses, (depths[0], depths[1])).mean())
