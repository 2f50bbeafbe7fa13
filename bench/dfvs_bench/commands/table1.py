"""``dfvs-bench table1``: every method in every scene, as in the paper's Table I."""

import argparse
import time
from collections.abc import Sequence
from typing import Any

from dfvs_bench.methods.registry import DEFAULT_METHODS, METHODS
from dfvs_bench.options import add_trial_options, run_trials, tasks_from, trial_setup
from dfvs_bench.trials.perturbation import (
    KINDS,
    PERTURBATIONS,
    STRENGTHS,
    check_perturbations,
    parse_perturbations,
)
from dfvs_bench.trials.provenance import run_facts
from dfvs_bench.trials.results import TrialRecord
from dfvs_bench.trials.tables import (
    perturbed_lines,
    row,
    summarise,
    summary_lines,
    trial_line,
    write_rows,
)
from dfvs_bench.trials.task import BenchTask
from dfvs_sim.options import write_json

_EPILOG = (
    "methods:\n"
    + "\n".join(f"  {name:<24} {kind.summary}" for name, kind in METHODS.items())
    + """

examples:
  dfvs-bench table1 --json table1.json --csv table1.csv --workers 2
  dfvs-bench table1 --tasks my_tasks.json --methods true-depth,sift --resume
  dfvs-bench table1 --perturb light,blur,occlusion,moved,noise-strong
  dfvs-bench table1 --dask tcp://127.0.0.1:8786

Every trial is kept in --runs; --resume runs those that are missing or were made with other
settings. The workers of a Dask cluster need this package, and the scenes at the same paths.
"""
)


def add_parser(subparsers: Any) -> None:
    """Add ``table1`` to the subcommands of ``dfvs-bench``."""
    parser = subparsers.add_parser(
        "table1",
        help="servoing methods in every scene: errors, path, iterations",
        description="Lead a free camera from start to goal in every scene with every method, and "
        "tabulate final errors, path length and iterations (DFVS Table I).",
        epilog=_EPILOG,
    )
    tasks_help = "tasks.json (default: the ten scenes)"
    add_trial_options(parser, tasks_help, "bench-runs", DEFAULT_METHODS)
    parser.add_argument(
        "--perturb",
        metavar="A,B",
        help="also with each of these between goal image and flight: "
        f"{', '.join(KINDS)}; medium, or with {' or '.join('-' + s for s in STRENGTHS)}",
    )
    parser.set_defaults(run=run)


def run(args: argparse.Namespace) -> int:
    """Run what is to be run, print the tables and write the files; exit code 0."""
    executor, methods = trial_setup(args, DEFAULT_METHODS)
    tasks = tasks_from(args)
    perturbations = parse_perturbations(args.perturb) if args.perturb is not None else []
    check_perturbations(perturbations, tasks)
    began_s = time.monotonic()
    args.runs.mkdir(parents=True, exist_ok=True)
    records = run_trials(args, executor, tasks, methods, perturbations)
    _finish(args, _in_order(records, tasks, methods), methods, time.monotonic() - began_s)
    return 0


def _in_order(
    records: Sequence[TrialRecord], tasks: Sequence[BenchTask], methods: Sequence[str]
) -> list[TrialRecord]:
    perturbations, names = ["", *PERTURBATIONS], [task.name for task in tasks]

    def place(record: TrialRecord) -> tuple[int, int, int]:
        perturbation = perturbations.index(record.perturbation)
        return perturbation, methods.index(record.method), names.index(record.task)

    return sorted(records, key=place)


def _finish(
    args: argparse.Namespace, records: list[TrialRecord], methods: list[str], wall_s: float
) -> None:
    summary = summarise(records, methods)
    for record in records:
        print(trial_line(record))
    tables = ["", *summary_lines(summary), "", *perturbed_lines(summary)]
    print("\n".join([*tables, f"this run took {wall_s / 60:.1f} min"]))
    if args.json is not None:
        write_json(args.json, summary | run_facts((r.revision for r in records), wall_s))
    if args.csv is not None:
        write_rows(args.csv, [row(record) for record in records])
