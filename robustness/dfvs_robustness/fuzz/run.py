"""Run of many episodes of a fuzz target on several cores, up to a number of events."""

from __future__ import annotations

import multiprocessing
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass, field
from multiprocessing.pool import Pool
from typing import Any, Generic, Protocol, TypeVar

from dfvs_common.child import end_worker_with_parent

EPISODES_PER_JOB = 8
MOST_FINDINGS = 10
"""A target that fails more often than that is broken; going on would tell nothing new."""


class Tally(Protocol):
    """Counts of what was run so far."""

    events: int

    def add(self, other: Any) -> None:
        """Count what another one of the same target counted."""


T = TypeVar("T", bound=Tally)
F = TypeVar("F")


@dataclass(frozen=True, slots=True)
class Target(Generic[T, F]):
    """What is fuzzed; its functions are found by name in every process.

    Parameters
    ----------
    tally : callable
        Gives an empty tally.
    live : callable
        Runs the episode of (seed, number), counts it in the tally, and returns what it found.
    shrink : callable
        Makes a finding short.
    """

    tally: Callable[[], T]
    run_episode: Callable[[tuple[int, int], T], F | None]
    shrink: Callable[[F], F]


@dataclass(frozen=True, slots=True)
class Job(Generic[T, F]):
    """A few episodes: the target, the seed and the numbers of the episodes."""

    target: Target[T, F]
    seed: int
    first: int
    count: int = EPISODES_PER_JOB


@dataclass(slots=True)
class Outcome(Generic[T, F]):
    """Result of a run, or of a part of it."""

    tally: T
    findings: list[F] = field(default_factory=list)
    busy_s: float = 0.0
    """Processor time of all workers, in s."""


def do(job: Job[T, F]) -> Outcome[T, F]:
    """Run the episodes of a job; what fails is shrunk."""
    target = job.target
    outcome: Outcome[T, F] = Outcome(target.tally())
    began_s = time.process_time()
    for number in range(job.first, job.first + job.count):
        finding = target.run_episode((job.seed, number), outcome.tally)
        if finding is not None:
            outcome.findings.append(target.shrink(finding))
    outcome.busy_s = time.process_time() - began_s
    return outcome


def run_episodes(
    target: Target[T, F],
    events: int,
    workers: int,
    seed: int,
    on_progress: Callable[[Outcome[T, F]], None],
) -> Outcome[T, F]:
    """Run episodes until they hold so many events.

    The episodes are numbered, and episode n of a seed is always the same, whatever the workers.

    Parameters
    ----------
    target : Target
        What is fuzzed.
    events : int
        Least number of events.
    workers : int
        Processes.
    seed : int
        Of all episodes.
    on_progress : callable
        Called with what was found so far.
    """
    total: Outcome[T, F] = Outcome(target.tally())
    with _outcomes(target, workers, seed) as outcomes:
        for outcome in outcomes:
            total.tally.add(outcome.tally)
            total.findings += outcome.findings
            total.busy_s += outcome.busy_s
            on_progress(total)
            if total.tally.events >= events or len(total.findings) >= MOST_FINDINGS:
                break
    return total


@contextmanager
def _outcomes(target: Target[T, F], workers: int, seed: int) -> Iterator[Iterator[Outcome[T, F]]]:
    """Give outcomes of one job after the other, for as long as they are asked for."""
    jobs = _jobs(target, seed)
    if workers == 1:
        yield map(do, jobs)
        return
    pool: Pool
    with multiprocessing.get_context("spawn").Pool(workers, end_worker_with_parent) as pool:
        yield _pooled(pool, jobs, workers)


def _jobs(target: Target[T, F], seed: int) -> Iterator[Job[T, F]]:
    first = 0
    while True:
        yield Job(target, seed, first)
        first += EPISODES_PER_JOB


def _pooled(pool: Pool, jobs: Iterator[Job[T, F]], workers: int) -> Iterator[Outcome[T, F]]:
    """Outcomes in the order of the jobs, with a few jobs in work at any time."""
    at_work = [pool.apply_async(do, (next(jobs),)) for _ in range(2 * workers)]
    while True:
        outcome = at_work.pop(0).get()
        at_work.append(pool.apply_async(do, (next(jobs),)))
        yield outcome
