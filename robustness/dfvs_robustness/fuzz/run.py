"""Many lives of the gate on several cores, until enough events were lived through."""

from __future__ import annotations

import multiprocessing
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass, field
from multiprocessing.pool import Pool

from dfvs_robustness.fuzz.gate_fuzz import Finding, Tally, live
from dfvs_robustness.fuzz.shrink import shrink
from dfvs_sim.child import end_worker_with_parent

LIVES_PER_JOB = 8
MOST_FINDINGS = 10
"""A gate that fails more often than that is broken; going on would tell nothing new."""


@dataclass(frozen=True, slots=True)
class Job:
    """A few lives: the seed and the numbers of the lives."""

    seed: int
    first: int
    count: int = LIVES_PER_JOB


@dataclass(slots=True)
class Outcome:
    """What a campaign, or a part of it, came to."""

    tally: Tally = field(default_factory=Tally)
    findings: list[Finding] = field(default_factory=list)
    busy_s: float = 0.0
    """Processor time of all workers, in s."""


def do(job: Job) -> Outcome:
    """Live the lives of a job; what fails is shrunk."""
    outcome, began_s = Outcome(), time.process_time()
    for number in range(job.first, job.first + job.count):
        finding = live((job.seed, number), outcome.tally)
        if finding is not None:
            outcome.findings.append(shrink(finding))
    outcome.busy_s = time.process_time() - began_s
    return outcome


def campaign(
    events: int, workers: int, seed: int, on_progress: Callable[[Outcome], None]
) -> Outcome:
    """Live lives until so many events were lived through.

    The lives are numbered, and life n of a seed is always the same, whatever the workers.

    Parameters
    ----------
    events : int
        Least number of events.
    workers : int
        Processes.
    seed : int
        Of all lives.
    on_progress : callable
        Called with what was found so far.
    """
    total = Outcome()
    with _outcomes(workers, seed) as outcomes:
        for outcome in outcomes:
            total.tally.add(outcome.tally)
            total.findings += outcome.findings
            total.busy_s += outcome.busy_s
            on_progress(total)
            if total.tally.events >= events or len(total.findings) >= MOST_FINDINGS:
                break
    return total


@contextmanager
def _outcomes(workers: int, seed: int) -> Iterator[Iterator[Outcome]]:
    """Give outcomes of one job after the other, for as long as they are asked for."""
    if workers == 1:
        yield map(do, _jobs(seed))
        return
    pool: Pool
    with multiprocessing.get_context("spawn").Pool(workers, end_worker_with_parent) as pool:
        yield _pooled(pool, _jobs(seed), workers)


def _jobs(seed: int) -> Iterator[Job]:
    first = 0
    while True:
        yield Job(seed, first)
        first += LIVES_PER_JOB


def _pooled(pool: Pool, jobs: Iterator[Job], workers: int) -> Iterator[Outcome]:
    """Outcomes in the order of the jobs, with a few jobs in work at any time."""
    at_work = [pool.apply_async(do, (next(jobs),)) for _ in range(2 * workers)]
    while True:
        outcome = at_work.pop(0).get()
        at_work.append(pool.apply_async(do, (next(jobs),)))
        yield outcome
