"""Tasks in the settings that learned pose regression was published for."""

import math
from collections.abc import Callable, Mapping
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np

from dfvs_bench.trials.scenes import CAMERA, TASKS_FILE, default_tasks
from dfvs_bench.trials.task import BenchTask, write_tasks
from dfvs_core.errors import ConfigError
from dfvs_core.geometry.arrays import FloatArray, ImageArray
from dfvs_core.geometry.poses import invert_pose, make_pose, se3_exp, se3_log, so3_exp
from dfvs_sim.render.renderer import Renderer
from dfvs_sim.scene.glb import load_glb
from dfvs_sim.scene.glb_writer import save_glb
from dfvs_sim.scene.mesh import Scene
from dfvs_sim.scene.texture import Texture, Wrap
from dfvs_sim.viewpoints.poses import camera_pose

_WALL_M = 2.0
"""Distance of the plane."""
_WALL_SPAN = 5.0
"""Width of the plane in that of the photograph, which is mirrored beyond its borders."""
_PHOTOGRAPH = CAMERA.scaled(1280, 960)
_PLANAR_TRANSLATION = (0.12, 0.12, 0.06)
"""Over the plane's distance: 2.4, 2.4 and 1.2 cm at 20 cm, with which Bateux et al. converge in 65
of 100 cases (DFVS, section III-C)."""
_PLANAR_ROTATION_RAD = tuple(np.radians((12.0, 12.0, 30.0)))
_QUALITY = 90


@dataclass(frozen=True, slots=True)
class Setting:
    """How a task of the benchmark becomes one of this setting."""

    make: Callable[[BenchTask, int, float, Path], BenchTask]
    """Takes a task, its number, a share of the greatest displacement, and a folder for scenes."""
    share: float
    """By default."""
    summary: str


def setting_tasks(name: str, share: float | None, folder: Path) -> list[BenchTask]:
    """Write the tasks of a setting, and its scenes, into a folder.

    Raises
    ------
    DfvsError
        If the share is none, or the folder cannot be written.
    """
    setting = SETTINGS[name]
    share = setting.share if share is None else share
    if not 0.0 < share <= 1.0:
        raise ConfigError(f"--share is {share:g}", "more than 0, 1 at most")
    try:
        folder.mkdir(parents=True, exist_ok=True)
        tasks = [setting.make(t, k, share, folder) for k, t in enumerate(default_tasks())]
        write_tasks(folder / TASKS_FILE, tasks)
    except OSError as error:
        raise ConfigError(f"{folder} cannot be written ({error.strerror})", "a folder") from error
    return tasks


def _near(task: BenchTask, _number: int, share: float, _folder: Path) -> BenchTask:
    """A start on the way to the goal."""
    T_goal_start = invert_pose(task.T_world_goal) @ task.T_world_start
    start = task.T_world_goal @ se3_exp(share * se3_log(T_goal_start))
    return replace(task, T_world_start=start)


def _planar(task: BenchTask, number: int, share: float, folder: Path) -> BenchTask:
    """The goal's view as a photograph on a wall, and a start displaced along all axes."""
    scene = folder / f"wall-{task.name}.glb"
    photograph = Renderer(load_glb(task.scene)).render(_PHOTOGRAPH, task.T_world_goal, True).image
    save_glb(scene, wall(photograph), _QUALITY)
    signs = np.random.default_rng([number, 8]).choice([-1.0, 1.0], 6)
    translation = share * signs[:3] * _PLANAR_TRANSLATION * _WALL_M
    T_goal_start = make_pose(so3_exp(share * signs[3:] * _PLANAR_ROTATION_RAD), translation)
    T_goal: FloatArray = camera_pose((0.0, 0.0, 0.0), 0.0)
    return replace(task, scene=scene, T_world_start=T_goal @ T_goal_start, T_world_goal=T_goal)


def wall(photograph: ImageArray) -> Scene:
    """A plane 2 m to the north that shows a photograph (H, W, 3), as wide as 90 degrees there."""
    width_m = 2.0 * _WALL_M * math.tan(math.radians(45.0))
    height_m = width_m * photograph.shape[0] / photograph.shape[1]
    corners = np.array([(-1, -1), (1, -1), (1, 1), (-1, 1)]) * _WALL_SPAN / 2
    east_down = corners * (width_m, height_m)
    return Scene(
        vertices=np.column_stack([np.full(4, _WALL_M), east_down]).astype(np.float32),
        triangles=np.array([(0, 1, 2), (0, 2, 3)], np.int32),
        uv=(corners + 0.5).astype(np.float32),
        colours=np.ones((4, 3), np.float32),
        texture_index=np.zeros(2, np.int32),
        textures=(Texture(photograph, Wrap.MIRROR, Wrap.MIRROR),),
    )


SETTINGS: Mapping[str, Setting] = {
    "planar": Setting(
        _planar,
        1.0,
        "the goal views on a wall 2 m away; starts 24, 24 and 12 cm and 12, 12 and 30° aside, as in"
        " the experiments of Bateux et al.",
    ),
    "near": Setting(
        _near,
        0.25,
        "the ten scenes; starts on a part of the way, as in the trajectories of Saxena et al.",
    ),
}
"""By name; ``--share`` scales the displacement."""
