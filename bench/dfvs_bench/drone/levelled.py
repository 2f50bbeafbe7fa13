"""The benchmark's tasks with four degrees of freedom: a multirotor's camera stays level."""

import math
from dataclasses import replace

from dfvs_bench.trials.task import BenchTask
from dfvs_core.errors import GeometryError
from dfvs_core.geometry.arrays import FloatArray
from dfvs_core.geometry.poses import wrap_angle
from dfvs_sim.viewpoints.poses import camera_pose

_STEEPEST_RAD = math.radians(80.0)


def levelled(T_world_camera: FloatArray) -> FloatArray:
    """Pose (4, 4) of a level camera at the same place, that looks the same way in the plan.

    Raises
    ------
    GeometryError
        If the camera looks so steeply up or down that it has no heading.
    """
    north, east, down = (float(v) for v in T_world_camera[:3, 2])
    pitch_rad = math.atan2(-down, math.hypot(north, east))
    if abs(pitch_rad) > _STEEPEST_RAD:
        raise GeometryError(
            f"a camera pitched by {math.degrees(pitch_rad):.0f} degrees has no heading to keep",
            "a view within 80 degrees of the horizon",
        )
    x, y, z = (float(v) for v in T_world_camera[:3, 3])
    return camera_pose((x, y, z), math.atan2(east, north))


def levelled_task(task: BenchTask) -> BenchTask:
    """A task with start and goal levelled: the goal's roll and pitch are left out of it.

    A multirotor cannot hold them: the goal image is taken anew from the levelled goal.

    Raises
    ------
    GeometryError
        If start or goal has no heading.
    """
    try:
        start, goal = levelled(task.T_world_start), levelled(task.T_world_goal)
    except GeometryError as error:
        raise GeometryError(
            f"task {task.name!r}: {error.problem}", error.expected, "--scenes leaves it out"
        ) from error
    return replace(task, T_world_start=start, T_world_goal=goal)


def turn_rad(T_world_start: FloatArray, T_world_goal: FloatArray) -> float:
    """Change of heading between two poses (4, 4) of a camera that is about level, in [-pi, pi)."""
    start, goal = (
        math.atan2(float(T[1, 2]), float(T[0, 2])) for T in (T_world_start, T_world_goal)
    )
    return wrap_angle(goal - start)
