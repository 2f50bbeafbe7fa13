"""What a flight is to be: scene, camera, start and goal, all known before anything starts."""

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from dfvs_core.errors import ConfigError
from dfvs_core.geometry.arrays import FloatArray, ImageArray
from dfvs_core.geometry.camera import CameraModel
from dfvs_core.geometry.poses import invert_pose, make_pose, pose_error, rotation_from_euler
from dfvs_core.messages.goal import GoalSidecar, Mount
from dfvs_sim.demo.floor import TakeOff, take_off_from_floor
from dfvs_sim.render.renderer import Renderer
from dfvs_sim.viewpoints.sampling import sample_task


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

    def goal_image(self, T_scene_goal: FloatArray | None = None) -> ImageArray:
        """Image of a goal (H, W, 3), of the last one by default, anti-aliased as an optic's."""
        pose = self.T_scene_goal if T_scene_goal is None else T_scene_goal
        return self.renderer.render(self.camera, pose, antialias=True).image

    def goal_sidecar(self, T_scene_goal: FloatArray) -> GoalSidecar:
        """How the image of a goal was taken."""
        pose = tuple(float(v) for v in T_scene_goal.reshape(-1))
        return GoalSidecar(self.camera, mount=self.mount, pose_camera=pose)

    def take_off(self) -> TakeOff:
        """How far the vehicle climbs from the scene's floor to the start."""
        T_camera_body = invert_pose(self.mount.T_body_camera())
        poses = (self.T_scene_start, *self.goals)
        return take_off_from_floor(self.renderer, [(T @ T_camera_body)[:3, 3] for T in poses])

    def T_scene_local(self, T_local_ground: FloatArray, height_m: float) -> FloatArray:
        """Where the autopilot's local frame lies in the scene, so that hovering is the start.

        Parameters
        ----------
        T_local_ground : (4, 4)
            Body on the ground before take-off, in the local frame.
        height_m : float
            How far it will climb.
        """
        yaw = math.atan2(T_local_ground[1, 0], T_local_ground[0, 0])
        hover = T_local_ground[:3, 3] - np.array([0.0, 0.0, height_m])
        T_local_hover = make_pose(rotation_from_euler(0.0, 0.0, yaw), hover)
        T_scene_body = self.T_scene_start @ invert_pose(self.mount.T_body_camera())
        return T_scene_body @ invert_pose(T_local_hover)


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
