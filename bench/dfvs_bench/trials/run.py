"""Many trials, one after the other or side by side; those that are on disk are not run again."""

import functools
import threading
import time
from collections.abc import Sequence
from dataclasses import dataclass
from importlib.metadata import version
from pathlib import Path

from dfvs_bench.methods.method import Networks, median_depth_m
from dfvs_bench.methods.registry import METHODS
from dfvs_bench.trials.perturbation import (
    Disturbance,
    Perturbation,
    disturbance,
    perturbed_renderer,
    undisturbed,
)
from dfvs_bench.trials.provenance import input_digest
from dfvs_bench.trials.results import TrialRecord, fits, read_record, record_path
from dfvs_bench.trials.task import BenchTask
from dfvs_bench.trials.trial import goal_observation, run_trial
from dfvs_core.matching.matcher import Matcher
from dfvs_models.catalog import load_matcher
from dfvs_sim.render.renderer import Renderer
from dfvs_sim.scene.glb import load_glb

_ONE_AT_A_TIME = threading.Lock()


@dataclass(frozen=True, slots=True)
class Job:
    """A trial to be made."""

    task: BenchTask
    """Scene and poses."""
    method: str
    matcher: str
    """Both are names, as ``METHODS`` and ``load_matcher`` know them."""
    most_iterations: int
    """Frames that the method is given."""
    revision: str
    network: str | None = None
    """Bundle of the network that the method needs beside the matcher, if any."""
    perturbation: Perturbation | None = None
    """Between the goal image and the flight."""

    @property
    def condition(self) -> str:
        """Name of the perturbation; empty where there is none."""
        return self.perturbation.name if self.perturbation else ""


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


class Countdown:
    """Tells how far a run of so many jobs is, and how long it still takes by what it took."""

    def __init__(self, count: int) -> None:
        self._count, self._done = count, 0
        self._began_s = time.monotonic()

    def step(self) -> str:
        """Count one more as done: ``[12/70, 9 min left]``."""
        self._done += 1
        elapsed_s = time.monotonic() - self._began_s
        left_min = elapsed_s / self._done * (self._count - self._done) / 60.0
        return f"[{self._done}/{self._count}, {left_min:.0f} min left]"


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
        median_depth_m=median_depth_m(goal.depth),
        network=job.network or "",
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
