"""The sixteen environments that a batch of trials is spread over."""

import os
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from pathlib import Path

from dfvs_bench.trials.scenes import CAMERA
from dfvs_bench.trials.task import BenchTask
from dfvs_core.errors import ConfigError
from dfvs_core.geometry.camera import CameraModel
from dfvs_rooms.lighting.bake import light_room
from dfvs_rooms.room_types.room_types import ROOM_KINDS, room_of_kind
from dfvs_sim.scene.glb_writer import save_glb

BATCH = 16
"""Environments in a batch, as in the paper."""

ROOMS_VERSION = 4
"""Part of the cache folder's name: to be raised whenever other rooms would come out."""

_FIRST_SEED = 4121
_MOST_EMPTY = 0.3
"""In anybody's scenes: outside of a scanned room there is little but its holes to see."""


@dataclass(frozen=True, slots=True)
class Environment:
    """A scene in which tasks are drawn."""

    name: str
    """Unique among those of a batch."""
    scene: Path
    """GLB file."""
    camera: CameraModel
    """Intrinsics of all views."""
    most_empty: float = 1.0
    """Share of a goal image, at most, that may show no surface: the sky, or a scan's holes."""


def default_environments() -> list[Environment]:
    """Sixteen rooms, of every kind in turn; their files are in the cache, or yet to be made.

    The cache lies under ``$XDG_CACHE_HOME``, or ``~/.cache``. The rooms' seeds, 4121 to 4136, are
    kept for the benchmark, and not those of its ten scenes.
    """
    base = os.environ.get("XDG_CACHE_HOME") or str(Path.home() / ".cache")
    folder = Path(base) / "dfvs" / f"bench-basin-{ROOMS_VERSION}"
    kinds = [ROOM_KINDS[k % len(ROOM_KINDS)] for k in range(BATCH)]
    names = [f"{kind}-{_FIRST_SEED + k}" for k, kind in enumerate(kinds)]
    return [Environment(name, folder / f"{name}.glb", CAMERA) for name in names]


def make_missing(environments: Sequence[Environment], progress: Callable[[str], None]) -> None:
    """Make the rooms of ``default_environments`` that are not in the cache yet, quickly lit.

    Raises
    ------
    ConfigError
        If the cache cannot be written.
    """
    missing = [place for place in environments if not place.scene.is_file()]
    for done, place in enumerate(missing):
        progress(f"making environment {place.name} ({done + 1} of {len(missing)})")
        kind, _, seed = place.name.rpartition("-")
        try:
            place.scene.parent.mkdir(parents=True, exist_ok=True)
            part = place.scene.with_suffix(".part.glb")
            save_glb(part, light_room(room_of_kind(kind, int(seed)), int(seed)))
            part.replace(place.scene)
        except OSError as error:
            raise ConfigError(f"{place.scene} cannot be written ({error.strerror})") from error


def environments_of(tasks: list[BenchTask]) -> list[Environment]:
    """Scenes and cameras of tasks; their poses are not used."""
    return [Environment(task.name, task.scene, task.camera, _MOST_EMPTY) for task in tasks]


def environments_in(scenes: list[Path]) -> list[Environment]:
    """Anybody's scenes, with the camera of the ten."""
    return [Environment(scene.stem, scene.absolute(), CAMERA, _MOST_EMPTY) for scene in scenes]
