"""What a flight is to be: scene, camera, start, goal and height above the scene's floor.

All of it is known before anything starts.
"""

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from dfvs_core.errors import ConfigError
from dfvs_core.geometry.arrays import FloatArray, ImageArray
from dfvs_core.geometry.camera import CameraModel
from dfvs_core.geometry.poses import invert_pose, make_pose, pose_error, rotation_from_euler
from dfvs_core.messages.goal import GoalSidecar, Mount
from dfvs_sim.ground.pilot import LEAST_HEIGHT_M, MOST_HEIGHT_M, USUAL_HEIGHT_M
from dfvs_sim.render.renderer import Renderer
from dfvs_sim.viewpoints.sampling import sample_task

_DOWNWARDS: FloatArray = np.eye(3)
"""Rotation world from camera of a view straight down: the optical axis is NED's down."""
_PROBE = CameraModel.from_horizontal_fov(64, 64, math.radians(120.0))
_LEAST_SEEN = 0.05
"""Share of the downward view that must show something."""
_LOWEST_PERCENT = 95.0
"""Percentile of the surfaces below that is the floor: furniture is above it, stray points below."""


@dataclass(frozen=True, slots=True)
class TakeOff:
    """How far to climb, and what the user has to know of it; empty where nothing."""

    height_m: float
    remark: str = ""


@dataclass(frozen=True, slots=True)
class FlightPlan:
    """One flight: camera poses (4, 4) in the scene (NED), level all of them.

    ``via`` are goals on the way, in their order; ``T_scene_goal`` is the last one.
    """

    renderer: Renderer
    camera: CameraModel
    mount: Mount
    T_scene_start: FloatArray
    T_scene_goal: FloatArray
    seed: int
    via: tuple[FloatArray, ...] = ()

    @property
    def initial_error(self) -> tuple[float, float]:
        """Distance in m and angle in rad between start and goal."""
        return pose_error(self.T_scene_start, self.T_scene_goal)

    @property
    def goals(self) -> tuple[FloatArray, ...]:
        """Poses of all goals, in their order."""
        return *self.via, self.T_scene_goal

    def goal_image(self, T_scene_goal: FloatArray) -> ImageArray:
        """Image of a goal (H, W, 3), anti-aliased as an optic's."""
        return self.renderer.render(self.camera, T_scene_goal, antialias=True).image

    def goal_sidecar(self, T_scene_goal: FloatArray) -> GoalSidecar:
        """How the image of a goal was taken."""
        pose = tuple(float(v) for v in T_scene_goal.reshape(-1))
        return GoalSidecar(self.camera, mount=self.mount, pose_camera=pose)

    def take_off(self) -> TakeOff:
        """How far the vehicle climbs from the scene's floor to the start."""
        T_camera_body = invert_pose(self.mount.T_body_camera())
        poses = (self.T_scene_start, *self.goals)
        return take_off_from_floor(self.renderer, [(T @ T_camera_body)[:3, 3] for T in poses])

    def T_scene_local(self, T_local_hover: FloatArray) -> FloatArray:
        """Where the autopilot's local frame lies in the scene, so that the hover is the start.

        The vehicle's ground then is the scene's floor, but for the error of its climb. The tilt of
        ``T_local_hover`` (4, 4), the body after the take-off, is left out.
        """
        yaw = math.atan2(T_local_hover[1, 0], T_local_hover[0, 0])
        level = make_pose(rotation_from_euler(0.0, 0.0, yaw), T_local_hover[:3, 3])
        T_scene_body = self.T_scene_start @ invert_pose(self.mount.T_body_camera())
        return T_scene_body @ invert_pose(level)


def make_plan(
    renderer: Renderer,
    camera: CameraModel,
    seed: int,
    start: FloatArray | None,
    goals: Sequence[FloatArray],
) -> FlightPlan:
    """Plan a flight between given poses, or between poses drawn from the seed.

    Raises
    ------
    ConfigError
        If only one of the two poses is given.
    """
    if (start is None) != (not goals):
        missing = "--start" if start is None else "--goal"
        raise ConfigError(f"{missing} is missing", "--start and --goal together, or neither")
    if start is None:
        task = sample_task(renderer, camera, np.random.default_rng(seed))
        start, goals = task.T_world_start, [task.T_world_goal]
    *via, last = goals
    return FlightPlan(renderer, camera, Mount(), start, last, seed, tuple(via))


def _floor_below(renderer: Renderer, point: FloatArray) -> float | None:
    """Level (down, m) of the floor below a point (3,) in NED; None where nothing is below it."""
    depth = renderer.depth(_PROBE, make_pose(_DOWNWARDS, point))
    seen = depth[depth > 0]
    if seen.size < _LEAST_SEEN * depth.size:
        return None
    return float(point[2]) + float(np.percentile(seen, _LOWEST_PERCENT))


def take_off_from_floor(renderer: Renderer, points: Sequence[FloatArray]) -> TakeOff:
    """Climb to the first point (3,) from the lowest floor below any of them (NED, m).

    The ground of a simulated vehicle is flat: where floors differ it is the lowest one, so that
    the vehicle does not touch it on its way.
    """
    floors = [level for p in points if (level := _floor_below(renderer, p)) is not None]
    if not floors:
        return TakeOff(
            USUAL_HEIGHT_M,
            f"the scene has no floor under the start: the ground is put {USUAL_HEIGHT_M:g} m below",
        )
    height_m = max(floors) - float(points[0][2])
    if LEAST_HEIGHT_M <= height_m <= MOST_HEIGHT_M:
        return TakeOff(height_m)
    bounded_m = min(max(height_m, LEAST_HEIGHT_M), MOST_HEIGHT_M)
    return TakeOff(
        bounded_m,
        f"the start is {height_m:.2f} m above the scene's floor: the ground is put "
        f"{bounded_m:g} m below",
    )
