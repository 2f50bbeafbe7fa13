"""``dfvs-bench controller``: how a trial went, as in the paper's Fig. 5."""

import argparse
from pathlib import Path
from typing import Any

from dfvs_bench.methods.registry import chosen_methods
from dfvs_bench.report.figures import controller_figure, figure_format
from dfvs_bench.trials.results import read_records
from dfvs_common.command_line import require_file
from dfvs_core.errors import ConfigError

_EPILOG = """example:
  dfvs-bench controller --runs bench-runs --scene hall --out controller.png
"""


def add_parser(subparsers: Any) -> None:
    """Add ``controller`` to the subcommands of ``dfvs-bench``."""
    parser = subparsers.add_parser(
        "controller",
        help="plots of error, velocities and path of trials",
        description="Plot the trials that table1 kept of one task: error, velocities, camera path "
        "(DFVS Fig. 5).",
        epilog=_EPILOG,
    )
    add = parser.add_argument
    add("--runs", type=Path, default=Path("bench-runs"), metavar="DIR", help="default: bench-runs")
    add("--scene", required=True, metavar="NAME", help="name of the task")
    add("--methods", metavar="A,B", help="default: all that are there")
    add("--out", type=Path, required=True, metavar="FILE", help=".png, .svg or .pdf")
    parser.set_defaults(run=run)


def run(args: argparse.Namespace) -> int:
    """Plot; exit code 0."""
    file_format = figure_format("--out", args.out)
    require_file("--out", args.out)
    records = [r for r in read_records(args.runs) if (r.task, r.perturbation) == (args.scene, "")]
    if args.methods:
        names = chosen_methods(args.methods.split(","))
        records = [r for r in records if r.method in names]
    if not records:
        raise ConfigError(
            f"{args.runs} holds no such trial of {args.scene!r}", "what table1 has run"
        )
    args.out.write_bytes(controller_figure(records, file_format))
    print(f"wrote {args.out}")
    return 0
