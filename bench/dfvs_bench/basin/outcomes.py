"""The basin's tasks on disk, and what came of them."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from pathlib import Path

from dfvs_bench.basin.cells import Cell
from dfvs_bench.basin.drawing import DRAWING_VERSION, DrawnTask, DrawRequest, draw
from dfvs_bench.trials.documents import read_document, write_document
from dfvs_bench.trials.executor import TrialExecutor
from dfvs_bench.trials.provenance import file_digest
from dfvs_bench.trials.results import TrialRecord, read_record
from dfvs_bench.trials.task import same_poses
from dfvs_common.progress import log
from dfvs_core.geometry.camera import CameraModel

BASIN_FILE = "basin.json"
"""Holds the tasks, beside their trials."""


@dataclass(frozen=True, slots=True)
class DrawnEnvironment:
    """What was drawn in one environment, and all that it was drawn from."""

    name: str
    scene_sha256: str
    camera: CameraModel
    cells: tuple[Cell, ...]
    count: int
    seed: int
    version: int
    """``DRAWING_VERSION``; the rest is as in ``DrawRequest``."""
    tasks: tuple[DrawnTask, ...] = ()

    @classmethod
    def to_draw(cls, request: DrawRequest) -> DrawnEnvironment:
        """Describe what a request draws from."""
        place = request.environment
        head = place.name, file_digest(place.scene), place.camera
        return cls(*head, request.cells, request.count, request.seed, DRAWING_VERSION)


@dataclass(frozen=True, slots=True)
class BasinTasks:
    """The tasks of a run, environment by environment, as they are kept on disk."""

    environments: tuple[DrawnEnvironment, ...]


@dataclass(frozen=True, slots=True)
class Outcome:
    """A task of the basin and a trial in it."""

    drawn: DrawnTask
    seed: int
    record: TrialRecord


def draw_tasks(
    requests: Sequence[DrawRequest],
    folder: Path,
    executor: TrialExecutor,
    progress: Callable[[str], None],
) -> list[DrawnTask]:
    """Draw the requests and keep them in the folder; what is there from the same request stays.

    Raises
    ------
    DfvsError
        If no goal is found in a scene, or the folder's file is damaged.
    """
    path = folder / BASIN_FILE
    kept = {place.name: place for place in _read(path).environments} if path.is_file() else {}
    wanted = {request.environment.name: DrawnEnvironment.to_draw(request) for request in requests}
    done = {
        name: kept[name]
        for name, place in wanted.items()
        if name in kept and replace(kept[name], tasks=()) == place
    }
    left = [request for request in requests if request.environment.name not in done]
    for name, tasks in executor.finished(_draw_named, left):
        progress(f"drew {len(tasks)} tasks in {name}")
        done[name] = replace(wanted[name], tasks=tasks)
        write_document(path, BasinTasks(tuple(done[n] for n in wanted if n in done)))
    return [task for name in wanted for task in done[name].tasks]


def _draw_named(request: DrawRequest) -> tuple[str, tuple[DrawnTask, ...]]:
    return request.environment.name, draw(request)


def read_outcomes(folder: Path, records: Sequence[TrialRecord] | None = None) -> list[Outcome]:
    """Trials of the tasks that a folder of ``dfvs-bench basin`` holds, whatever their method.

    Others are counted aloud. They are looked for among ``records``; None reads all in the folder.

    Raises
    ------
    ConfigError
        If the folder holds no tasks, or a file is damaged.
    """
    places = _read(folder / BASIN_FILE).environments
    tasks = {task.name: (task, place.seed) for place in places for task in place.tasks}
    if records is None:
        records = [read_record(path) for path in sorted(folder.glob("*--*.json"))]
    found = [(tasks.get(record.task), record) for record in records]
    outcomes = [
        Outcome(*known, record)
        for known, record in found
        # made from these very poses, and not from another seed's
        if known and same_poses((record.start, record.goal), (known[0].start, known[0].goal))
    ]
    if left := len(records) - len(outcomes):
        log(f"{left} trials in {folder} are of other tasks than {BASIN_FILE} has: left out")
    return outcomes


def _read(path: Path) -> BasinTasks:
    return read_document(BasinTasks, path, str(path), "the file of dfvs-bench basin")
