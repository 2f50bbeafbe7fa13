"""Run of many episodes of a fuzz target on several cores, up to a number of events.

What fails is made as short as possible.
"""

import functools
import itertools
import json
import multiprocessing
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass, field, fields
from multiprocessing.pool import Pool
from pathlib import Path
from typing import Any, Generic, Self, TypeVar

from dfvs_common.child import end_worker_with_parent
from dfvs_core.errors import ConfigError
from dfvs_robustness.fuzz.finding import Finding, InvariantError

EPISODES_PER_JOB = 8
MOST_FINDINGS = 10
"""A target that fails more often than that is broken; going on would tell nothing new."""


@dataclass(slots=True)
class Tally:
    """Counts of what was run so far."""

    episodes: int = 0
    events: int = 0

    def add(self, other: Self) -> None:
        """Count what another one of the same target counted."""
        for field_ in fields(self):
            total = getattr(self, field_.name) + getattr(other, field_.name)
            setattr(self, field_.name, total)


T = TypeVar("T", bound=Tally)
E = TypeVar("E")
Item = TypeVar("Item")


@dataclass(frozen=True, slots=True)
class Target(Generic[T, E]):
    """What is fuzzed; its functions are found by name in every process."""

    tally: Callable[[], T]
    """Gives an empty tally."""
    run_episode: Callable[[tuple[int, int], T], Finding[E] | None]
    """Runs the episode of (seed, number), counts it in the tally, and returns what it found."""
    replay: Callable[[E], InvariantError | None]
    """Runs an episode again; returns the first violation."""
    shorten: Callable[[E, Callable[[E], bool]], E]
    """Makes an episode as short as possible that still fails."""
    format: str
    """Name of the format of its findings, in every file."""
    dump: Callable[[E], dict[str, Any]]
    """Takes an episode to what JSON can hold."""
    build: Callable[[dict[str, Any]], E]
    """Makes an episode of that again."""

    def write(self, finding: Finding[E], path: Path) -> None:
        """Write a finding; NaN and infinity are kept, as Python's JSON knows them.

        Raises
        ------
        ConfigError
            If the file cannot be written.
        """
        head = {"format": self.format, "rule": finding.rule, "text": finding.text}
        text = json.dumps(head | self.dump(finding.episode), indent=1) + "\n"
        try:
            path.write_text(text, encoding="utf-8")
        except OSError as error:
            raise ConfigError(
                f"cannot write {path} ({error.strerror})", "a writable folder"
            ) from error

    def read(self, path: Path) -> E:
        """Episode of a finding; ConfigError if the file cannot be read or is not of this format."""
        try:
            document = json.loads(path.read_text(encoding="utf-8"))
            if document["format"] != self.format:
                raise ConfigError(f"{path} has format {document['format']!r}", repr(self.format))
            return self.build(document)
        except OSError as error:
            raise ConfigError(f"cannot read {path} ({error.strerror})", "a replay file") from error
        except (ValueError, KeyError, TypeError, AttributeError) as error:
            raise ConfigError(f"{path} is no replay ({error!r})", repr(self.format)) from error

    def shrink(self, finding: Finding[E]) -> Finding[E]:
        """Return a finding as short as possible that violates the same invariant."""

        def fails(episode: E) -> bool:
            violation = self.replay(episode)
            return violation is not None and violation.rule == finding.rule

        if not fails(finding.episode):  # found by running it otherwise: nothing shorter is known
            return finding
        shortest = self.shorten(finding.episode, fails)
        violation = self.replay(shortest)
        return Finding(shortest, finding.rule, violation.text if violation else finding.text)


@dataclass(slots=True)
class Outcome(Generic[T, E]):
    """Result of a run, or of a part of it."""

    tally: T
    findings: list[Finding[E]] = field(default_factory=list)
    busy_s: float = 0.0
    """Processor time of all workers, in s."""


def run_job(target: Target[T, E], seed: int, numbers: range) -> Outcome[T, E]:
    """Run the episodes with these numbers; what fails is shrunk."""
    outcome: Outcome[T, E] = Outcome(target.tally())
    began_s = time.process_time()
    for number in numbers:
        finding = target.run_episode((seed, number), outcome.tally)
        if finding is not None:
            outcome.findings.append(target.shrink(finding))
    outcome.busy_s = time.process_time() - began_s
    return outcome


def run_episodes(
    target: Target[T, E],
    events: int,
    workers: int,
    seed: int,
    on_progress: Callable[[Outcome[T, E]], None],
) -> Outcome[T, E]:
    """Run episodes until they hold so many events; ``on_progress`` is told what was found so far.

    The episodes are numbered, and episode n of a seed is always the same, whatever the workers.
    """
    total: Outcome[T, E] = Outcome(target.tally())
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
def _outcomes(target: Target[T, E], workers: int, seed: int) -> Iterator[Iterator[Outcome[T, E]]]:
    """Give outcomes of one job after the other, for as long as they are asked for."""
    work = functools.partial(run_job, target, seed)
    jobs = (range(n, n + EPISODES_PER_JOB) for n in itertools.count(0, EPISODES_PER_JOB))
    if workers == 1:
        yield map(work, jobs)
        return
    pool: Pool
    with multiprocessing.get_context("spawn").Pool(workers, end_worker_with_parent) as pool:
        yield _pooled(pool, work, jobs, workers)


def _pooled(
    pool: Pool,
    work: Callable[[range], Outcome[T, E]],
    jobs: Iterator[range],
    workers: int,
) -> Iterator[Outcome[T, E]]:
    """Outcomes in the order of the jobs, with a few jobs in work at any time."""
    at_work = [pool.apply_async(work, (next(jobs),)) for _ in range(2 * workers)]
    while True:
        outcome = at_work.pop(0).get()
        at_work.append(pool.apply_async(work, (next(jobs),)))
        yield outcome


def shrink_list(items: list[Item], fails: Callable[[list[Item]], bool]) -> list[Item]:
    """Leave out parts of a failing list, then single items, as long as what is left still fails.

    This is delta debugging; ``fails`` tells whether a list fails.
    """
    size = max(len(items) // 2, 1)
    while True:
        start, shortened = 0, False
        while start < len(items):
            rest = items[:start] + items[start + size :]
            if fails(rest):
                items, shortened = rest, True
            else:
                start += size
        if size == 1 and not shortened:
            return items
        size = max(size // 2, 1)
