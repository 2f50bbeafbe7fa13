"""Servoing tasks: a scene, where the camera starts, where it shall go; and files of them."""

import json
import re
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Literal

import numpy as np
from numpy.typing import ArrayLike

from dfvs_core.errors import ConfigError
from dfvs_core.geometry.arrays import FloatArray
from dfvs_core.geometry.camera import CameraModel
from dfvs_core.geometry.poses import check_pose, pose_error
from dfvs_core.messages.schema import dump, parse
from dfvs_sim.scene.frames import gltf_pose_from_ned, ned_pose_from_gltf

Axes = Literal["gltf", "ned"]
_NAME = re.compile(r"[^\s./\\][^/\\\0-\x1f]{0,99}")
"""Names become those of files."""
_ROUNDED = 5e-3
"""By so much ``R R^T`` may differ from 1 in a file that keeps three decimals."""
_EXPECTED = "a list of tasks (name, scene, start, goal, intrinsics), or {'tasks': [...]}"


@dataclass(frozen=True, slots=True, eq=False)
class BenchTask:
    """One task of the benchmark."""

    name: str
    """Unique in its file."""
    scene: Path
    """GLB file."""
    T_world_start: FloatArray
    T_world_goal: FloatArray
    """Both are camera poses (4, 4), NED, m."""
    camera: CameraModel
    """Intrinsics of both views."""
    difficulty: str = ""
    """``easy``, ``medium`` or ``hard``, or nothing."""
    seed: int | None = None
    """That scene and poses were drawn from, where they were."""

    @property
    def poses(self) -> tuple[FloatArray, FloatArray]:
        """``T_world_start`` and ``T_world_goal``, row by row (16,)."""
        return self.T_world_start.ravel(), self.T_world_goal.ravel()

    @property
    def initial_error(self) -> tuple[float, float]:
        """Distance in m and angle in rad between start and goal."""
        return pose_error(self.T_world_start, self.T_world_goal)

    def to_dict(self, folder: Path) -> dict[str, Any]:
        """Entry of a task file that lies in a folder, poses in the scene file's axes."""
        scene = self.scene.absolute()
        near = scene.is_relative_to(folder.absolute())
        return {
            "name": self.name,
            "difficulty": self.difficulty,
            "seed": self.seed,
            "scene": str(scene.relative_to(folder.absolute()) if near else scene),
            "axes": "gltf",
            "start": gltf_pose_from_ned(self.T_world_start).tolist(),
            "goal": gltf_pose_from_ned(self.T_world_goal).tolist(),
            "intrinsics": dump(self.camera),
        }


@dataclass(frozen=True, slots=True)
class _Entry:
    """A task as its file has it."""

    name: str
    scene: str
    start: tuple[tuple[float, ...], ...]
    goal: tuple[tuple[float, ...], ...]
    intrinsics: CameraModel
    axes: Axes = "gltf"
    difficulty: str = ""
    seed: int | None = None


def same_poses(first: tuple[ArrayLike, ArrayLike], second: tuple[ArrayLike, ArrayLike]) -> bool:
    """Whether two pairs of start and goal are the same, to within what a file keeps."""
    return all(np.allclose(a, b, atol=1e-9) for a, b in zip(first, second, strict=True))


def read_tasks(path: Path) -> list[BenchTask]:
    """Read a task file; scenes are looked for beside it, and from the working folder.

    Rotations that were rounded, to three decimals or more, are made orthonormal.

    Raises
    ------
    ConfigError
        If it cannot be read or does not hold tasks with names of their own.
    GeometryError
        If a pose is no rigid motion.
    """
    try:
        document = json.loads(path.read_text(encoding="utf-8"))
    except (OSError, ValueError) as error:
        raise ConfigError(f"task file {path} cannot be read ({error})", _EXPECTED) from error
    entries = document.get("tasks") if isinstance(document, Mapping) else document
    if not isinstance(entries, list) or not entries:
        raise ConfigError(f"task file {path} holds no tasks", _EXPECTED)
    tasks = [_task(entry, path.parent, f"task {k}") for k, entry in enumerate(entries)]
    names = [task.name for task in tasks]
    for name in names:
        if names.count(name) > 1 or not _NAME.fullmatch(name):
            raise ConfigError(
                f"task file {path} has a task named {name!r}",
                "names of their own, of up to 100 characters, that files can have",
            )
    return tasks


def write_tasks(path: Path, tasks: list[BenchTask]) -> None:
    """Write a task file."""
    document = {"tasks": [task.to_dict(path.parent) for task in tasks]}
    path.write_text(json.dumps(document, indent=1) + "\n", encoding="utf-8")


def _task(data: object, folder: Path, where: str) -> BenchTask:
    entry = parse(_Entry, data, where)
    poses = []
    for name in ("start", "goal"):
        rows = getattr(entry, name)
        if [len(row) for row in rows] != [4] * 4:
            raise ConfigError(f"{where}: {name} is {rows}", "four rows of four numbers")
        T = check_pose(_unrounded(np.array(rows, dtype=np.float64)), f"{where}: {name}")
        poses.append(ned_pose_from_gltf(T) if entry.axes == "gltf" else T)
    scene = (folder / entry.scene).absolute()
    if not scene.is_file() and Path(entry.scene).is_file():
        scene = Path(entry.scene).absolute()
    if not scene.is_file():
        raise ConfigError(f"{where}: there is no scene {scene}", "a GLB file")
    return BenchTask(
        entry.name, scene, poses[0], poses[1], entry.intrinsics, entry.difficulty, entry.seed
    )


def _unrounded(T: FloatArray) -> FloatArray:
    """Pose (4, 4) with the rotation nearest to one that was rounded; others stay as they are."""
    R = T[:3, :3]
    if not np.isfinite(R).all() or np.abs(R @ R.T - np.eye(3)).max() > _ROUNDED:
        return T
    u, _, v = np.linalg.svd(R)
    result = T.copy()
    result[:3, :3] = u @ v
    return result
