"""Many trials, one after the other or side by side; those that are on disk are not run again."""

import functools
import threading
import time
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from importlib.metadata import version
from pathlib import Path

from dfvs_bench.methods.method import Networks
from dfvs_bench.methods.registry import METHODS
from dfvs_bench.trials.executor import TrialExecutor
from dfvs_bench.trials.inputs import input_digest
from dfvs_bench.trials.perturbation import (
    Disturbance,
    Perturbation,
    disturbance,
    perturbed_renderer,
    undisturbed,
)
from dfvs_bench.trials.results import TrialRecord, fits, git_revision, read_record, record_path
from dfvs_bench.trials.results import write_record as keep_record
from dfvs_bench.trials.task import BenchTask
from dfvs_bench.trials.trial import goal_observation, run_trial
from dfvs_core.matching.matcher import Matcher
from dfvs_models.catalog import load_matcher
from dfvs_sim.render.renderer import Renderer
from dfvs_sim.scene.glb import load_glb

_ONE_AT_A_TIME = threading.Lock()


@dataclass(frozen=True, slots=True)
class Job:
    """A trial to be made.

    Parameters
    ----------
    task : BenchTask
        Scene and poses.
    method, matcher : str
        Names, as ``METHODS`` and ``load_matcher`` know them.
    most_iterations : int
        Frames that the method is given.
    revision : str
        Of the program.
    network : str, optional
        Bundle of the network that the method needs beside the matcher, if any.
    perturbation : Perturbation, optional
        Between the goal image and the flight.
    """

    task: BenchTask
    method: str
    matcher: str
    most_iterations: int
    revision: str
    network: str | None = None
    perturbation: Perturbation | None = None

    @property
    def condition(self) -> str:
        """Name of the perturbation; empty where there is none."""
        return self.perturbation.name if self.perturbation else ""


@dataclass(frozen=True, slots=True)
class Plan:
    """What a run is to try.

    Parameters
    ----------
    tasks : sequence of BenchTask
    methods : sequence of str
        Names of methods.
    matcher : str
        Name of the matcher that they share.
    most_iterations : int or None
        Frames for every method; None gives each its authors' number.
    networks : mapping
        Bundles of the networks that methods need, by ``MethodKind.network``.
    perturbations : sequence of Perturbation
        Each is tried as well as none.
    """

    tasks: Sequence[BenchTask]
    methods: Sequence[str]
    matcher: str
    most_iterations: int | None = None
    networks: Mapping[str, str] = field(default_factory=dict)
    perturbations: Sequence[Perturbation] = ()

    def jobs(self) -> list[Job]:
        """All trials, scene by scene."""
        revision = git_revision()
        return [
            Job(
                task,
                name,
                self.matcher,
                self.most_iterations or METHODS[name].iterations,
                revision,
                self.networks[METHODS[name].network] if METHODS[name].network else None,
                perturbation,
            )
            for task in self.tasks
            for perturbation in (None, *self.perturbations)
            for name in self.methods
        ]


def unfinished(jobs: Sequence[Job], folder: Path) -> tuple[list[Job], list[TrialRecord]]:
    """Jobs without a record that fits, and the records that the others have."""
    left, found = [], []
    for job in jobs:
        path = record_path(folder, job.task.name, job.method, job.condition)
        record = read_record(path) if path.is_file() else None
        if (
            record is not None
            and record.perturbation == job.condition
            and fits(record, job.task, job.matcher, job.most_iterations, job.network)
        ):
            found.append(record)
        else:
            left.append(job)
    return left, found


def run_jobs(jobs: Sequence[Job], folder: Path, executor: TrialExecutor) -> Iterator[TrialRecord]:
    """Run trials and keep each one's record in the folder, as they come.

    Raises
    ------
    DfvsError
        If a scene, the matcher or the executor cannot be used.
    """
    for record in executor.finished(run_job, jobs):
        keep_record(folder, record)
        yield record


def run_job(job: Job) -> TrialRecord:
    """Make one trial; trials of one process follow each other, for they share what is cached."""
    with _ONE_AT_A_TIME:
        return _make_trial(job)


def _make_trial(job: Job) -> TrialRecord:
    started = time.monotonic()
    renderer = renderer_of(job.task.scene)
    goal, networks = goal_observation(job.task, renderer), _networks(job.method, job.network)
    method = METHODS[job.method].make(goal, _matcher(job.matcher), networks)
    disturb: Disturbance = undisturbed
    if job.perturbation is not None:
        renderer = perturbed_renderer(job.perturbation, job.task, renderer)
        disturb = disturbance(job.perturbation, job.task)
    trial = run_trial(job.task, method, renderer, job.most_iterations, disturb)
    return TrialRecord(
        task=job.task.name,
        difficulty=job.task.difficulty,
        method=job.method,
        matcher=job.matcher,
        most_iterations=job.most_iterations,
        start=tuple(job.task.T_world_start.ravel().tolist()),
        goal=tuple(job.task.T_world_goal.ravel().tolist()),
        size=job.task.camera.size,
        version=version("dfvs"),
        revision=job.revision,
        seconds=time.monotonic() - started,
        trial=trial,
        inputs=input_digest(job.task, job.matcher, network=job.network),
        seed=job.task.seed,
        perturbation=job.condition,
        median_depth_m=goal.median_depth_m,
    )


@functools.lru_cache(maxsize=2)
def renderer_of(scene: Path) -> Renderer:
    """Renderer of the scene at hand; jobs come scene by scene."""
    return Renderer(load_glb(scene))


@functools.lru_cache(maxsize=4)
def _networks(method: str, bundle: str | None) -> Networks:
    return METHODS[method].load(bundle)


@functools.lru_cache(maxsize=1)
def _matcher(name: str) -> Matcher:
    return load_matcher(name, threads=1)
