"""``dfvs-bench report``: what table1 found, as one HTML page."""

from __future__ import annotations

import argparse
import sys
from pathlib import Path
from typing import Any

from dfvs_core.errors import ConfigError
from dfvs_sim.bench.report import report_page
from dfvs_sim.bench.results import read_records
from dfvs_sim.bench.scenes import default_tasks
from dfvs_sim.bench.task import read_tasks

_EPILOG = """example:
  dfvs-bench report --runs bench-runs --out report.html
"""


def add_parser(subparsers: Any) -> None:
    """Add ``report`` to the subcommands of ``dfvs-bench``."""
    parser = subparsers.add_parser(
        "report",
        help="one HTML page of tables, pictures and plots",
        description="Gather the trials that table1 kept into one self-contained HTML page: tables, "
        "pictures (DFVS Fig. 4), plots (Fig. 5), and the paper's figures beside ours.",
        epilog=_EPILOG,
        formatter_class=argparse.RawDescriptionHelpFormatter,
    )
    add = parser.add_argument
    add("--runs", type=Path, default=Path("bench-runs"), metavar="DIR", help="default: bench-runs")
    add("--tasks", type=Path, metavar="FILE", help="tasks.json (default: the ten scenes)")
    add("--out", type=Path, required=True, metavar="FILE", help="page to write (.html)")
    parser.set_defaults(run=run)


def run(args: argparse.Namespace) -> int:
    """Write the page; exit code 0.

    Raises
    ------
    DfvsError
        If there are no trials of these tasks, or the output cannot be written.
    """
    if args.out.suffix.lower() != ".html" or not args.out.absolute().parent.is_dir():
        raise ConfigError(f"--out is {str(args.out)!r}", "a name that ends in .html, in a folder")
    records = read_records(args.runs)
    tasks = read_tasks(args.tasks) if args.tasks else default_tasks()
    names = {task.name for task in tasks}
    records = [record for record in records if record.task in names]
    if not records:
        raise ConfigError(f"{args.runs} holds no trials of these tasks", "what table1 has run")
    page = report_page(tasks, records, lambda name: print(name, file=sys.stderr, flush=True))
    args.out.write_text(page, encoding="utf-8")
    print(f"wrote {args.out} ({len(page) / 1e6:.1f} MB)")
    return 0
