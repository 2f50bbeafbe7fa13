"""The ten scenes of the benchmark: rooms made from seeds, and a task drawn in each.

Every task has the distance and the angle of one row of the paper's Table I; three are easy, four
medium and three hard, as the paper defines that. Scenes and tasks come with the package, so that
everybody measures in the same ones, to the bit; here is also what they were made by.
"""

import math
from collections.abc import Callable
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np

from dfvs_bench.trials.task import BenchTask, read_tasks, write_tasks
from dfvs_bench.trials.task_sampling import TaskConstraints, draw_task
from dfvs_core.errors import ConfigError
from dfvs_core.geometry.arrays import FloatArray
from dfvs_core.geometry.camera import CameraModel
from dfvs_rooms.lighting.bake import bake_room, light_room
from dfvs_rooms.lighting.fast import FINE
from dfvs_rooms.lighting.path_traced import BakeSettings
from dfvs_rooms.room_types.room_types import room_of_kind
from dfvs_sim.render.renderer import Renderer
from dfvs_sim.scene.glb import load_glb
from dfvs_sim.scene.glb_writer import save_glb
from dfvs_sim.scene.mesh import SceneError

CAMERA = CameraModel.from_horizontal_fov(320, 240, math.radians(90.0))
"""The paper's field of view, at a size that a companion computer works on."""

TASKS_FILE = "tasks.json"
ASSETS = Path(__file__).resolve().parent.parent / "assets"


@dataclass(frozen=True, slots=True)
class SceneSpec:
    """A scene of the benchmark."""

    name: str
    kind: str
    """Of its room."""
    seed: int
    """Decides on the room, and on the task in it."""
    difficulty: str
    """``easy``, ``medium`` or ``hard``."""
    distance_m: float
    angle_deg: float
    """Both are between start and goal."""

    @property
    def constraints(self) -> TaskConstraints:
        """What the task must be like."""
        features, overlap = _RULES[self.difficulty]
        return TaskConstraints(self.distance_m, math.radians(self.angle_deg), overlap, features)


_RULES = {"easy": (150, (0.5, 0.9)), "medium": (80, (0.4, 0.75)), "hard": (50, (0.25, 0.65))}
"""Least SIFT points in each view, and share of the goal that the start sees, by difficulty."""

_IN_OTHERS = TaskConstraints(1.5, math.radians(20.0), (0.4, 0.75), features=80, most_empty=0.1)
"""Of tasks in anybody's scenes."""

SCENES = (
    SceneSpec("living-room", "living-room", 4101, "easy", 1.42, 18.20),
    SceneSpec("kitchen", "kitchen", 4112, "easy", 1.49, 16.33),
    SceneSpec("library", "library", 4103, "easy", 1.41, 18.07),
    SceneSpec("bedroom", "bedroom", 4104, "medium", 1.15, 17.27),
    SceneSpec("office", "office", 4105, "medium", 1.64, 30.96),
    SceneSpec("corridor", "passage", 4106, "medium", 1.37, 17.26),
    SceneSpec("hall", "canteen", 4107, "medium", 1.95, 22.86),
    SceneSpec("workshop", "workshop", 4108, "hard", 2.54, 20.02),
    SceneSpec("staircase", "gallery", 4109, "hard", 1.94, 31.78),
    SceneSpec("courtyard", "courtyard", 4110, "hard", 2.43, 36.05),
)
"""The ten, in the order of the paper's Table I."""


def default_tasks() -> list[BenchTask]:
    """Tasks of the ten scenes, which come with the package."""
    return read_tasks(ASSETS / TASKS_FILE)


def make_scenes(
    folder: Path,
    specs: tuple[SceneSpec, ...],
    progress: Callable[[str], None],
    traced: BakeSettings | None = None,
) -> list[BenchTask]:
    """Make rooms and tasks in a folder; rooms that are there already are kept.

    With ``traced`` settings the rooms are lit by path tracing as well, once their tasks are drawn:
    the tasks are the same in either light. The ten that come with the package were made so.

    Raises
    ------
    DfvsError
        If the folder cannot be written, no task fits into a room, or light is to be traced and
        Mitsuba is not installed.
    """
    try:
        folder.mkdir(parents=True, exist_ok=True)
    except OSError as error:
        raise ConfigError(f"{folder} cannot be made ({error.strerror})", "a folder") from error
    tasks = []
    for spec in specs:
        progress(f"{spec.name}: {spec.kind} from seed {spec.seed}")
        task = _task(spec, _room_file(spec, folder))
        if traced is not None:
            task = replace(task, scene=_traced_file(spec, folder, traced, progress))
        tasks.append(task)
    write_tasks(folder / TASKS_FILE, tasks)
    return tasks


def _room_file(spec: SceneSpec, folder: Path) -> Path:
    path = folder / f"{spec.kind}-{spec.seed}.glb"
    if not path.is_file():
        save_glb(path, light_room(room_of_kind(spec.kind, spec.seed), spec.seed, FINE))
    return path


def _traced_file(
    spec: SceneSpec, folder: Path, settings: BakeSettings, progress: Callable[[str], None]
) -> Path:
    path = folder / f"{spec.kind}-{spec.seed}-traced-{settings.samples}.glb"
    if not path.is_file():
        room = room_of_kind(spec.kind, spec.seed)

        def tell(done: int, count: int) -> None:
            progress(f"{spec.name}: light of {done} of {count} vertices")

        save_glb(path, bake_room(room, settings, tell))
    return path


def _task(spec: SceneSpec, scene: Path) -> BenchTask:
    poses = _drawn(scene, spec.constraints, np.random.default_rng([spec.seed, 3]))
    return BenchTask(spec.name, scene, *poses, CAMERA, spec.difficulty, spec.seed)


def task_in(scene: Path) -> BenchTask:
    """Draw one task of medium difficulty in anybody's scene: 1.5 m and 20 degrees.

    Raises
    ------
    DfvsError
        If the scene cannot be read, or has no room for one.
    """
    seed = 0
    poses = _drawn(scene, _IN_OTHERS, np.random.default_rng(seed))
    return BenchTask(scene.stem, scene.absolute(), *poses, CAMERA, "medium", seed)


def _drawn(
    scene: Path, wanted: TaskConstraints, rng: np.random.Generator
) -> tuple[FloatArray, FloatArray]:
    poses = draw_task(Renderer(load_glb(scene)), CAMERA, wanted, rng)
    if poses is None:
        raise SceneError(
            f"no task of {wanted.distance_m:g} m and {math.degrees(wanted.angle_rad):.0f} "
            f"degrees found in {scene}",
            f"free space, {wanted.features} SIFT points in each view, at most "
            f"{wanted.most_empty:.0%} of it without a surface, and {wanted.overlap[0]:.0%} of "
            "the goal in view at the start",
            "poses of your own, in a file for --tasks",
        )
    return poses
