"""Worker processes of the matrix, and what they report."""

import multiprocessing
import time
from collections import deque
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass
from multiprocessing.connection import Connection, wait
from multiprocessing.process import BaseProcess
from typing import Self, TypeAlias

from dfvs_common.child import describe_end
from dfvs_robustness.faults.fault import NO_VERDICT, Case, Outcome

_GRACE_S = 10.0
"""For a worker to end its service and to remove its folder."""


@dataclass(frozen=True, slots=True)
class Result:
    """What one worker reports: an outcome, or violations of a run."""

    outcome: Outcome | None = None
    violations: tuple[str, ...] = ()


OnResult: TypeAlias = Callable[[Result], None]
"""Takes what the workers report, as it comes."""

Work: TypeAlias = Callable[[list[Case], float, Connection], None]
"""Runs cases in their order until a monotonic time in s, and sends a Result of each."""


@dataclass(frozen=True, slots=True)
class _Worker:
    """A process that runs a group of cases, and those of them that it has not reported yet."""

    process: BaseProcess
    results: Connection
    group: list[Case]
    unreported: list[Case]

    @classmethod
    def start(cls, group: list[Case], until: float, work: Work) -> Self:
        """Start it, with the only open end to write results to."""
        context = multiprocessing.get_context("spawn")
        results, ours = context.Pipe(duplex=False)
        process = context.Process(target=work, args=(group, until, ours), daemon=False)
        process.start()
        ours.close()
        return cls(process, results, group, list(group))

    def receive(self) -> Result | None:
        """What it reports, None once it has ended, be it in the middle of a report."""
        try:
            result: Result = self.results.recv()
        except (EOFError, OSError):
            return None
        if (o := result.outcome) is not None:
            self.unreported.remove(Case(o.fault, o.state, o.seed))
        return result

    def end(self) -> Result | None:
        """Wait for its end; the case that it has died in, which has no verdict."""
        self.process.join(_GRACE_S)
        code = self.process.exitcode
        self.process.kill()
        self.results.close()
        if code in (None, 0):  # None: it closed its pipe, and only its end takes long
            return None
        # Where all were reported, the records of the last run were not judged.
        case = self.unreported.pop(0) if self.unreported else self.group[-1]
        return Result(no_verdict(case, f"worker died, it {describe_end(code)}"))


@contextmanager
def _ended_at_last() -> Iterator[list[_Worker]]:
    """Workers that run; they end with the context, and at once at an error, such as a signal."""
    running: list[_Worker] = []
    try:
        yield running
    except BaseException:
        for worker in running:
            worker.process.terminate()
        raise
    finally:
        for worker in running:
            worker.process.join(_GRACE_S)
            worker.process.kill()


def run_groups(
    groups: Sequence[list[Case]], workers: int, until: float, on_result: OnResult, work: Work
) -> None:
    """Run each group in a process of its own, so many at a time.

    Each has a pipe of its own, so one that is killed while it writes holds up nobody. Its case
    fails without a verdict, and another process runs the rest of its group.
    """
    left = deque(groups)
    with _ended_at_last() as running:
        while True:
            while left and len(running) < workers and time.monotonic() < until:
                running.append(_Worker.start(left.popleft(), until, work))
            if not running:
                return
            ready = wait([worker.results for worker in running])
            for worker in [worker for worker in running if worker.results in ready]:
                if (result := worker.receive()) is not None:
                    on_result(result)
                    continue
                died = worker.end()
                running.remove(worker)
                if died is not None:
                    on_result(died)
                    if worker.unreported:
                        left.appendleft(worker.unreported)


def no_verdict(case: Case, problem: str, attempts: int = 1) -> Outcome:
    """Outcome of a case that did not come to its end; the problem says why."""
    never = float("inf")
    return Outcome(
        case.fault, case.state, case.seed, False, never, "", f"{NO_VERDICT}: {problem}", attempts
    )
