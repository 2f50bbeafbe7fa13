"""Trials on disk: one JSON file each, so that a broken run can be taken up again."""

from dataclasses import dataclass
from importlib.metadata import version
from pathlib import Path

from dfvs_bench.trials.documents import read_document, write_document
from dfvs_bench.trials.provenance import input_digest
from dfvs_bench.trials.task import BenchTask, same_poses
from dfvs_bench.trials.trial import Trial
from dfvs_core.errors import ConfigError


@dataclass(frozen=True, slots=True)
class TrialRecord:
    """A trial with everything that it depended on."""

    task: str
    difficulty: str
    method: str
    matcher: str
    """It is given to every method, whether it uses it or not."""
    most_iterations: int
    """Frames that the method was given."""
    start: tuple[float, ...]
    goal: tuple[float, ...]
    """Both are poses (4, 4) row by row, NED."""
    size: tuple[int, ...]
    """Width and height of the images, px."""
    version: str
    revision: str
    seconds: float
    """How long it took on the machine."""
    trial: Trial
    inputs: str = ""
    """Hash of scene, intrinsics and models; see ``input_digest``."""
    seed: int | None = None
    """That the scene and the task were drawn from, where they were."""
    perturbation: str = ""
    """Name of the perturbation between goal image and flight; empty where there is none."""
    median_depth_m: float | None = None
    """Of the goal view, unperturbed."""
    network: str = ""
    """Bundle of the depth or pose network that the method needs; empty where it needs none."""

    @property
    def initial_error(self) -> tuple[float, float]:
        """Distance in m and angle in rad at the start."""
        first = self.trial.steps[0]
        return first.distance_m, first.angle_rad

    @property
    def final_share(self) -> float | None:
        """Final distance over the median depth of the goal view."""
        return self.trial.final.distance_m / self.median_depth_m if self.median_depth_m else None


def record_path(folder: Path, task: str, method: str, perturbation: str = "") -> Path:
    """Where the record of a task, a method and a perturbation lies."""
    return folder / f"{'--'.join(filter(None, (task, method, perturbation)))}.json"


def write_record(folder: Path, record: TrialRecord) -> None:
    """Write a record, whole or not at all."""
    path = record_path(folder, record.task, record.method, record.perturbation)
    write_document(path, record)


def read_record(path: Path) -> TrialRecord:
    """Read a record.

    Raises
    ------
    ConfigError
        If it is none.
    """
    return read_document(TrialRecord, path, f"record {path}", "a file of table1")


def read_records(folder: Path) -> list[TrialRecord]:
    """Read all records of a folder, by method and task in the order of their names.

    Raises
    ------
    ConfigError
        If there are none, or one is damaged.
    """
    paths = sorted(folder.glob("*--*.json"))
    if not paths:
        raise ConfigError(f"{folder} holds no trials", "the folder that dfvs-bench table1 filled")
    return sorted((read_record(path) for path in paths), key=lambda r: (r.method, r.task))


def fits(
    record: TrialRecord,
    task: BenchTask,
    matcher: str,
    most_iterations: int,
    network: str | None = None,
) -> bool:
    """Tell whether a record is of this very task, with these settings and this program.

    ``network`` is the bundle of the network that the method needs beside the matcher, if any.

    Raises
    ------
    DfvsError
        If the scene or a model cannot be read.
    """
    return (
        same_poses((record.start, record.goal), task.poses)
        and (record.matcher, record.most_iterations) == (matcher, most_iterations)
        and record.version == version("dfvs")
        and (not record.perturbation or record.seed == task.seed)
        and record.inputs == input_digest(task, matcher, network=network)
    )
