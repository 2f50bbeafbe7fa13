"""The matrix: every fault in every state with every seed, in parallel, resumable."""

import dataclasses
import json
import shutil
import tempfile
import time
import traceback
from collections.abc import Sequence
from multiprocessing.connection import Connection
from pathlib import Path

from dfvs_common.child import end_worker_with_parent
from dfvs_common.lifecycle import exit_on_signals
from dfvs_core.errors import ConfigError
from dfvs_core.gate.states import GateState
from dfvs_robustness.faults import invariants
from dfvs_robustness.faults.case import run_case
from dfvs_robustness.faults.fault import Case, Fault, Outcome
from dfvs_robustness.faults.judging import timed
from dfvs_robustness.faults.table import all_faults
from dfvs_robustness.faults.workers import OnResult, Result, no_verdict, run_groups
from dfvs_robustness.harness.harness import Harness
from dfvs_robustness.harness.load import take_precedence
from dfvs_robustness.harness.records import Run
from dfvs_robustness.harness.setup import Setup

_ATTEMPTS = 3
"""A state that is not reached, on a busy machine say, is tried for again: it is no verdict."""

_CASES_PER_HARNESS = 30
"""Seeds of one setup share a harness, and a service where it survives, up to so many cases."""


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


def run_matrix(cases: Sequence[Case], workers: int, until: float, on_result: OnResult) -> None:
    """Run cases in processes of their own until all are done, or no more begins at ``until`` (s).

    Those that disturb others come last, one at a time.
    """
    faults = all_faults()
    alone = [case for case in cases if faults[case.fault].alone]
    others = [case for case in cases if not faults[case.fault].alone]
    run_groups(shared_harness(others), workers, until, on_result, _work)
    run_groups(shared_harness(alone), 1, until, on_result, _work)


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


def _work(group: list[Case], until: float, results: Connection) -> None:
    """One worker process: a group of cases in a folder of its own."""
    exit_on_signals()
    end_worker_with_parent()
    take_precedence()
    folder = Path(tempfile.mkdtemp(prefix="dfvs-faults-"))
    with results:
        try:
            _run_group(group, folder, results, until)
        except Exception:  # noqa: BLE001 - a broken harness must not end the whole matrix
            traceback.print_exc()
        finally:
            shutil.rmtree(folder, ignore_errors=True)


def _run_group(group: list[Case], folder: Path, results: Connection, until: float) -> None:
    """Run the cases of one setup in one harness, and check every run of its service."""
    faults = all_faults()
    harness = Harness(faults[group[0].fault].setup, folder, group[0].seed)

    def check_run(run: Run) -> None:
        found = invariants.check(run)
        results.send(Result(violations=tuple(f"{v.invariant}: {v.text}" for v in found)))

    harness.on_run_over = check_run
    try:
        for case in group:
            if time.monotonic() >= until:
                return
            fault = faults[case.fault]
            results.send(Result(_attempt(harness, fault, case)))
            if fault.restarts:
                harness.stop_service()
    finally:
        harness.close()


def _attempt(harness: Harness, fault: Fault, case: Case) -> Outcome:
    """Run a case; a state that is not reached is tried for again with a fresh service."""
    problem = ""
    for attempt in range(1, _ATTEMPTS + 1):
        try:
            outcome = run_case(harness, fault, GateState(case.state), case.seed)
            return dataclasses.replace(outcome, attempts=attempt)
        except Exception as error:  # noqa: BLE001 - whatever the harness fails at is reported
            problem = f"{type(error).__name__}, {error}"
            harness.stop_service()
    return no_verdict(case, problem, _ATTEMPTS)


# --- what was run already ---------------------------------------------------------------------


def read_outcomes(path: Path) -> tuple[dict[Case, Outcome], list[str]]:
    """Outcomes and violations of earlier slices, judged by the limits of today.

    Of a case that was run more than once, the last outcome counts.

    Raises
    ------
    ConfigError
        If the file holds anything else.
    """
    faults = all_faults()
    outcomes: dict[Case, Outcome] = {}
    violations: list[str] = []
    try:
        text = path.read_text(encoding="utf-8") if path.exists() else ""
        for line in text.splitlines():
            data = json.loads(line)
            if "violation" in data:
                violations.append(data["violation"])
            elif (outcome := Outcome(**data)).fault in faults:
                case = Case(outcome.fault, outcome.state, outcome.seed)
                outcomes[case] = timed(outcome, faults[outcome.fault])
    except (ValueError, TypeError) as error:
        made_by = "a file of: dfvs-robustness faults --keep FILE"
        raise ConfigError(f"{path} holds no results ({error})", made_by) from error
    return outcomes, violations


def append_result(path: Path, result: Result) -> None:
    """Keep what a worker reported."""
    with path.open("a", encoding="utf-8") as file:
        if result.outcome is not None:
            file.write(json.dumps(dataclasses.asdict(result.outcome)) + "\n")
        for text in result.violations:
            file.write(json.dumps({"violation": text}) + "\n")
