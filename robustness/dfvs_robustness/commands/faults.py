"""``dfvs-robustness faults``: disturb the real service in every way and state, and judge it."""

import argparse
import shlex
import time
from pathlib import Path
from typing import Any

from dfvs_common.command_line import require_file, require_folder, require_range
from dfvs_common.lifecycle import EXIT_FAILED, EXIT_OK
from dfvs_common.progress import log
from dfvs_robustness.answers.report import read_answers
from dfvs_robustness.faults.fault import Case
from dfvs_robustness.faults.matrix import append_result, plan, read_outcomes, run_matrix
from dfvs_robustness.faults.report import Report, make_rows
from dfvs_robustness.faults.table import all_faults
from dfvs_robustness.faults.workers import Result

_EPILOG = """examples:
  dfvs-robustness faults --only takeover --seeds 5             one fault, five times in every state
  dfvs-robustness faults --seeds 20 --workers 4 --keep runs.jsonl --html faults.html
                                                        everything; again, to go on
  dfvs-robustness faults --list                                the faults by name

exit code: 0 every planned case was run and passed, and no invariant was violated; 1 not so;
2 cannot run
"""


def add_parser(subparsers: Any) -> None:
    """Add ``faults`` to the subcommands of ``dfvs-robustness``."""
    parser = subparsers.add_parser(
        "faults",
        help="disturb the real service in every way and state, and judge it",
        description="Start the real dfvs-service beside a simulated vehicle, cause faults from "
        "outside in every state of the gate, and judge its reactions by the vehicle's record.",
        epilog=_EPILOG,
    )
    add = parser.add_argument
    add("--only", action="append", default=[], metavar="FAULT", help="may be repeated")
    add("--state", action="append", default=[], metavar="STATE", help="may be repeated")
    add("--seeds", type=int, default=1, metavar="N", help="times every case is run (default: 1)")
    add("--workers", type=int, default=2, metavar="N", help="services at a time (default: 2)")
    add("--minutes", type=float, default=600.0, metavar="M", help="begin no case after so long")
    add("--keep", type=Path, metavar="FILE", help="add results here, and leave out what is in it")
    add("--json", type=Path, metavar="FILE", help="write the table as JSON")
    add("--html", type=Path, metavar="FILE", help="write the table as HTML, and as Markdown beside")
    add("--remark", default="", metavar="TEXT", help="what readers of the report should know")
    add(
        "--answers", type=Path, metavar="FILE", help="add what dfvs-robustness answers --json wrote"
    )
    add("--list", action="store_true", help="print the faults and their states, run nothing")
    parser.set_defaults(run=run)


def run(args: argparse.Namespace) -> int:
    """Run the cases; 0 if all were run and passed, and nothing was violated."""
    require_range(args, 1, None, "seeds", "workers")
    require_range(args, 0, None, "minutes")
    require_folder("--keep", args.keep)
    for name in ("json", "html"):
        require_file(f"--{name}", getattr(args, name))
    if args.list:
        for fault in all_faults().values():
            print(f"{fault.name:26s} {fault.what:44s} {' '.join(fault.states)}")
        return EXIT_OK
    answers = read_answers(args.answers) if args.answers else None
    cases = plan(args.only, args.state, args.seeds)
    outcomes, violations = read_outcomes(args.keep) if args.keep else ({}, [])
    todo = [case for case in cases if case not in outcomes or not outcomes[case].has_verdict]
    log(f"{len(todo)} of {len(cases)} cases to run")

    def take(result: Result) -> None:
        if args.keep:
            append_result(args.keep, result)
        violations.extend(result.violations)
        for text in result.violations:
            log(f"  violated {text}")
        if (o := result.outcome) is not None:
            outcomes[Case(o.fault, o.state, o.seed)] = o
            word = "ok" if o.passed else f"FAILED: {o.problem}"
            left = len(set(cases) - set(outcomes))
            line = f"{o.fault:26s} {o.state:8s} seed {o.seed:<3d} {o.reaction_ms:7.0f} ms  {word}"
            log(f"{line}  ({left} left)")

    run_matrix(todo, args.workers, time.monotonic() + 60.0 * args.minutes, take)
    rows = make_rows(list(outcomes.values()), all_faults())
    not_run = len(set(cases) - set(outcomes))
    report = Report(rows, violations, not_run, _command(args), args.remark, answers)
    if args.json:
        report.write_json(args.json)
    if args.html:
        report.write_pages(args.html)
    print(report.verdict)
    return EXIT_OK if report.passed else EXIT_FAILED


def _command(args: argparse.Namespace) -> str:
    words = ["dfvs-robustness", "faults", "--seeds", str(args.seeds)]
    words += ["--workers", str(args.workers)]
    for name in args.only:
        words += ["--only", name]
    for state in args.state:
        words += ["--state", state]
    return shlex.join(words)
