"""The matrix: every fault in every state with every seed, in parallel, resumable."""

import dataclasses
import json
import multiprocessing
import queue
import shutil
import tempfile
import time
import traceback
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from multiprocessing.process import BaseProcess
from multiprocessing.queues import Queue
from pathlib import Path
from typing import TypeAlias

from dfvs_common.child import end_worker_with_parent
from dfvs_common.lifecycle import exit_on_signals
from dfvs_core.errors import ConfigError
from dfvs_core.gate.states import GateState
from dfvs_robustness.faults import invariants
from dfvs_robustness.faults.case import run_case
from dfvs_robustness.faults.commander_faults import commander_faults
from dfvs_robustness.faults.fault import NO_VERDICT, Fault, Outcome
from dfvs_robustness.faults.frame_faults import frame_faults
from dfvs_robustness.faults.judging import timed
from dfvs_robustness.faults.process_faults import process_faults
from dfvs_robustness.faults.start_faults import start_faults
from dfvs_robustness.faults.vehicle_faults import vehicle_faults
from dfvs_robustness.harness.harness import Harness
from dfvs_robustness.harness.load import take_precedence
from dfvs_robustness.harness.records import Run
from dfvs_robustness.harness.setup import Setup

Todo: TypeAlias = "Queue[list[Case] | None]"
Done: TypeAlias = "Queue[Result | None]"

_ATTEMPTS = 3
"""A state that is not reached, on a busy machine say, is tried for again: it is no verdict."""

_GRACE_S = 10.0
"""For a worker to end its service and to remove its folder."""

_POLL_S = 1.0
"""Between two looks at whether the workers are alive, while none reports anything."""

_CASES_PER_HARNESS = 30
"""Seeds of one setup share a harness, and a service where it survives, up to so many cases."""


@dataclass(frozen=True, slots=True)
class Case:
    """One cell of the matrix with one seed."""

    fault: str
    state: str
    seed: int


@dataclass(frozen=True, slots=True)
class Result:
    """What one worker reports: an outcome, or violations of a run."""

    outcome: Outcome | None = None
    violations: tuple[str, ...] = ()


def all_faults() -> dict[str, Fault]:
    """Every fault by its name, in the order of the table."""
    groups = (
        frame_faults(),
        start_faults(),
        vehicle_faults(),
        commander_faults(),
        process_faults(),
    )
    return {fault.name: fault for group in groups for fault in group}


def plan(only: Sequence[str], states: Sequence[str], seeds: int) -> list[Case]:
    """Cases of the chosen faults (all where none is named), seed by seed.

    Raises
    ------
    ConfigError
        If a fault or state is not known.
    """
    faults = all_faults()
    for name in only:
        if name not in faults:
            raise ConfigError(f"there is no fault {name!r}", f"one of {', '.join(faults)}")
    for state in states:
        if state not in list(GateState):
            raise ConfigError(f"there is no state {state!r}", f"one of {', '.join(GateState)}")
    chosen = [faults[name] for name in (only or faults)]
    return [
        Case(fault.name, str(state), seed)
        for seed in range(seeds)
        for fault in chosen
        for state in fault.states
        if not states or state in states
    ]


def run_matrix(
    cases: Sequence[Case], workers: int, until: float, on_result: Callable[[Result], None]
) -> None:
    """Run cases in processes of their own until all are done or the time is up.

    Those that disturb others come last, one at a time.

    Parameters
    ----------
    cases : sequence of Case
    workers : int
    until : float
        Monotonic time in s at which no further case is begun.
    on_result : callable
        Takes what the workers report, as it comes.
    """
    faults = all_faults()
    alone = [case for case in cases if faults[case.fault].alone]
    _run_groups(
        shared_harness([c for c in cases if c not in set(alone)]), workers, until, on_result
    )
    _run_groups(shared_harness(alone), 1, until, on_result)


def _run_groups(
    groups: Sequence[list[Case]], workers: int, until: float, on_result: Callable[[Result], None]
) -> None:
    context = multiprocessing.get_context("spawn")
    todo: Todo = context.Queue()
    done: Done = context.Queue()
    for group in groups:
        todo.put(group)
    processes = []
    for number in range(min(workers, len(groups))):
        todo.put(None)
        arguments = (number, todo, done, until)
        processes.append(context.Process(target=_work, args=arguments, daemon=False))
    for process in processes:
        process.start()
    try:
        pass_on(done, processes, on_result)
    except BaseException:  # such as a signal to end
        for process in processes:
            process.terminate()
        raise
    finally:
        for process in processes:
            process.join(_GRACE_S)
            process.kill()


def pass_on(
    done: Done, workers: Sequence[BaseProcess], on_result: Callable[[Result], None]
) -> None:
    """Pass on results until every worker has said that it is through, or none is alive.

    A worker that is killed says nothing; its cases have no outcome.
    """
    running = len(workers)
    while running:
        # Asked first: what a worker put before its end is in the queue by then.
        is_any_alive = any(worker.is_alive() for worker in workers)
        try:
            result = done.get(timeout=_POLL_S)
        except queue.Empty:
            if is_any_alive:
                continue
            return
        if result is None:
            running -= 1
        else:
            on_result(result)


def shared_harness(cases: Sequence[Case]) -> list[list[Case]]:
    """Cases that share a harness: of one setup, whole seeds of it, state by state.

    The groups of the first seeds come first, and of these the long ones. In one state after the
    other, since the way from one state to the next takes longer than a case.
    """
    faults = all_faults()
    found: dict[tuple[Setup, bool], list[list[Case]]] = {}
    for case in sorted(cases, key=lambda case: case.seed):
        fault = faults[case.fault]
        groups = found.setdefault((fault.setup, fault.restarts), [[]])
        if len(groups[-1]) >= _CASES_PER_HARNESS and groups[-1][-1].seed != case.seed:
            groups.append([])
        groups[-1].append(case)
    order = sorted(
        (g for groups in found.values() for g in groups), key=lambda g: (g[0].seed, -len(g))
    )
    states = list(GateState)
    return [sorted(group, key=lambda c: states.index(GateState(c.state))) for group in order]


def _work(number: int, todo: Todo, done: Done, until: float) -> None:
    """One worker process: groups one after the other."""
    exit_on_signals()
    end_worker_with_parent()
    take_precedence()
    while (group := todo.get()) is not None and time.monotonic() < until:
        folder = Path(tempfile.mkdtemp(prefix=f"dfvs-faults-{number}-"))
        try:
            _run_group(group, folder, done, until)
        except Exception:  # noqa: BLE001 - a broken harness must not hang the whole matrix
            traceback.print_exc()
        finally:
            shutil.rmtree(folder, ignore_errors=True)
    done.put(None)


def _run_group(group: list[Case], folder: Path, done: Done, until: float) -> None:
    """Run the cases of one setup in one harness, and check every run of its service."""
    faults = all_faults()
    harness = Harness(faults[group[0].fault].setup, folder, group[0].seed)

    def check_run(run: Run) -> None:
        found = invariants.check(run)
        done.put(Result(violations=tuple(f"{v.invariant}: {v.text}" for v in found)))

    harness.on_run_over = check_run
    try:
        for case in group:
            if time.monotonic() >= until:
                return
            fault = faults[case.fault]
            done.put(Result(outcome=_attempt(harness, fault, GateState(case.state), case.seed)))
            if fault.restarts:
                harness.stop_service()
    finally:
        harness.close()


def _attempt(harness: Harness, fault: Fault, state: GateState, seed: int) -> Outcome:
    """Run a case; a state that is not reached is tried for again with a fresh service."""
    problem = ""
    for attempt in range(1, _ATTEMPTS + 1):
        try:
            outcome = run_case(harness, fault, state, seed)
            return dataclasses.replace(outcome, attempts=attempt)
        except Exception as error:  # noqa: BLE001 - whatever the harness fails at is reported
            problem = f"{NO_VERDICT}: {type(error).__name__}, {error}"
            harness.stop_service()
    never = float("inf")
    return Outcome(fault.name, str(state), seed, False, never, "", problem, _ATTEMPTS)


# --- what was run already ---------------------------------------------------------------------


def read_outcomes(path: Path) -> tuple[dict[Case, Outcome], list[str]]:
    """Outcomes and violations of earlier slices, judged by the limits of today.

    Of a case that was run more than once, the last outcome counts.
    """
    faults = all_faults()
    outcomes: dict[Case, Outcome] = {}
    violations: list[str] = []
    if path.exists():
        for line in path.read_text(encoding="utf-8").splitlines():
            data = json.loads(line)
            if "violation" in data:
                violations.append(data["violation"])
            else:
                outcome = Outcome(**data)
                if outcome.fault in faults:
                    case = Case(outcome.fault, outcome.state, outcome.seed)
                    outcomes[case] = timed(outcome, faults[outcome.fault])
    return outcomes, violations


def append_result(path: Path, result: Result) -> None:
    """Keep what a worker reported."""
    with path.open("a", encoding="utf-8") as file:
        if result.outcome is not None:
            file.write(json.dumps(dataclasses.asdict(result.outcome)) + "\n")
        for text in result.violations:
            file.write(json.dumps({"violation": text}) + "\n")
