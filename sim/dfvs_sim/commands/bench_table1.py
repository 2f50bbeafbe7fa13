"""``dfvs-bench table1``: every method in every scene, as in the paper's Table I."""

from __future__ import annotations

import argparse
import sys
import time
from collections.abc import Sequence
from pathlib import Path
from typing import Any

from dfvs_core.errors import ConfigError
from dfvs_models import DEFAULT_MATCHER
from dfvs_models.catalog import load_matcher
from dfvs_sim.bench.campaign import Plan, run_jobs, unfinished
from dfvs_sim.bench.methods import DEFAULT_METHODS, METHODS, chosen_methods
from dfvs_sim.bench.results import TrialRecord
from dfvs_sim.bench.scenes import default_tasks
from dfvs_sim.bench.tables import summarise, summary_lines, trial_line, write_csv
from dfvs_sim.bench.task import BenchTask, read_tasks
from dfvs_sim.options import write_json

_EPILOG = (
    "methods:\n"
    + "\n".join(f"  {name:<15} {kind.summary}" for name, kind in METHODS.items())
    + """

examples:
  dfvs-bench table1 --json table1.json --csv table1.csv --workers 2
  dfvs-bench table1 --tasks my_tasks.json --methods true-depth,sift --resume

The ten scenes are made on the first call (minutes), as dfvs-bench scenes does. Every trial is
kept in --runs; --resume runs those that are missing or were made with other settings.
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
        formatter_class=argparse.RawDescriptionHelpFormatter,
    )
    add = parser.add_argument
    add("--tasks", type=Path, metavar="FILE", help="tasks.json (default: the ten scenes)")
    add("--scenes", metavar="A,B", help="names of the tasks to run (default: all)")
    add("--methods", metavar="A,B", help=f"default: {','.join(DEFAULT_METHODS)}")
    add("--bundle", default=DEFAULT_MATCHER, metavar="NAME", help="matcher: see dfvs-bench flow")
    add("--iterations", type=int, metavar="N", help="for every method (default: its authors')")
    add("--workers", type=int, default=1, metavar="N", help="processes (default: 1)")
    add("--runs", type=Path, default=Path("bench-runs"), metavar="DIR", help="default: bench-runs")
    add("--resume", action="store_true", help="keep the trials that are in --runs")
    add("--json", type=Path, metavar="FILE", help="write a summary")
    add("--csv", type=Path, metavar="FILE", help="write a row for every trial")
    parser.set_defaults(run=run)


def run(args: argparse.Namespace) -> int:
    """Run what is to be run, print the tables and write the files; exit code 0.

    Raises
    ------
    DfvsError
        If an option, a task or a scene cannot be used.
    """
    _check(args)
    methods = list(chosen_methods(args.methods.split(",") if args.methods else None))
    load_matcher(args.bundle, threads=1)  # refuses at once what cannot be used
    tasks = _tasks(args)
    jobs = Plan(tasks, methods, args.bundle, args.iterations).jobs()
    left, records = unfinished(jobs, args.runs) if args.resume else (jobs, [])
    args.runs.mkdir(parents=True, exist_ok=True)
    if records:
        print(f"{len(records)} trials are in {args.runs}", file=sys.stderr)
    started = time.monotonic()
    for record in run_jobs(left, args.runs, args.workers):
        records.append(record)
        done = len(records) - (len(jobs) - len(left))
        _show(record, done, len(left), time.monotonic() - started)
    _finish(args, _in_order(records, tasks, methods), methods)
    return 0


def _check(args: argparse.Namespace) -> None:
    if not 1 <= args.workers <= 256:
        raise ConfigError(f"--workers is {args.workers}", "1 to 256")
    if args.iterations is not None and args.iterations < 1:
        raise ConfigError(f"--iterations is {args.iterations}", "1 or more")
    for option, path in (("--json", args.json), ("--csv", args.csv), ("--runs", args.runs)):
        if path is not None and not path.absolute().parent.is_dir():
            raise ConfigError(f"{option} {path} lies in no folder", "an existing folder")


def _tasks(args: argparse.Namespace) -> list[BenchTask]:
    """Tasks of the file, or the ten scenes; those that are named, or all."""
    tasks = read_tasks(args.tasks) if args.tasks else default_tasks()
    if not args.scenes:
        return tasks
    known = {task.name: task for task in tasks}
    names = list(dict.fromkeys(args.scenes.split(",")))
    for name in names:
        if name not in known:
            raise ConfigError(f"there is no task {name!r}", f"some of {', '.join(known)}")
    return [known[name] for name in names]


def _show(record: TrialRecord, done: int, count: int, elapsed_s: float) -> None:
    left_min = elapsed_s / done * (count - done) / 60.0
    print(f"{trial_line(record)} [{done}/{count}, {left_min:.0f} min left]", file=sys.stderr)


def _in_order(
    records: Sequence[TrialRecord], tasks: Sequence[BenchTask], methods: Sequence[str]
) -> list[TrialRecord]:
    names = [task.name for task in tasks]
    return sorted(records, key=lambda r: (methods.index(r.method), names.index(r.task)))


def _finish(args: argparse.Namespace, records: list[TrialRecord], methods: list[str]) -> None:
    summary = summarise(records, methods)
    for record in records:
        print(trial_line(record))
    print("\n".join(["", *summary_lines(summary)]))
    if args.json is not None:
        write_json(args.json, summary)
    if args.csv is not None:
        write_csv(args.csv, records)
