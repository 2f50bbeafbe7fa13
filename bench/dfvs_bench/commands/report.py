"""``dfvs-bench report``: what table1, basin and drone found, as one HTML page."""

import argparse
from pathlib import Path
from typing import Any

from dfvs_bench.basin.outcomes import BASIN_FILE, read_outcomes
from dfvs_bench.drone.records import read_records as read_flights
from dfvs_bench.methods.registry import METHODS
from dfvs_bench.options import add_own_scenes, own_tasks
from dfvs_bench.report.report import Contents, report_page
from dfvs_bench.trials.results import TrialRecord, read_records
from dfvs_bench.trials.scenes import default_tasks
from dfvs_bench.trials.task import BenchTask, same_poses
from dfvs_common.command_line import require_file
from dfvs_common.progress import log
from dfvs_core.errors import ConfigError
from dfvs_models import DEFAULT_DEPTH
from dfvs_models.catalog import bundle_folder, load_depth_network

_EPILOG = """example:
  dfvs-bench report --runs bench-runs --basin basin-runs --drone drone-runs --out report.html
"""


def add_parser(subparsers: Any) -> None:
    """Add ``report`` to the subcommands of ``dfvs-bench``."""
    parser = subparsers.add_parser(
        "report",
        help="one HTML page of tables, pictures and plots",
        description="Gather what table1, basin and drone kept into one self-contained HTML page: "
        "tables, depth (DFVS Fig. 2), pictures (Fig. 4), plots (Fig. 5 and 6), and the paper's "
        "figures beside ours, made to be printed. What was not measured is left out.",
        epilog=_EPILOG,
    )
    add = parser.add_argument
    add(
        "--runs",
        type=Path,
        default=Path("bench-runs"),
        metavar="DIR",
        help="of table1 (default: bench-runs)",
    )
    add("--basin", type=Path, default=Path("basin-runs"), metavar="DIR", help="default: basin-runs")
    add("--drone", type=Path, default=Path("drone-runs"), metavar="DIR", help="default: drone-runs")
    add_own_scenes(parser, "tasks.json (default: the ten scenes)")
    add(
        "--depth-bundle",
        metavar="NAME",
        help=f"depth network to show beside the true depth (default: {DEFAULT_DEPTH}, if there)",
    )
    add("--out", type=Path, required=True, metavar="FILE", help="page to write (.html)")
    parser.set_defaults(run=run)


def run(args: argparse.Namespace) -> int:
    """Write the page; exit code 0."""
    require_file("--out", args.out, ".html")
    contents = _contents(args)
    page = report_page(contents, log)
    args.out.write_text(page, encoding="utf-8")
    print(f"wrote {args.out} ({len(page) / 1e6:.1f} MB)")
    return 0


def _contents(args: argparse.Namespace) -> Contents:
    """All that was measured; what was not is left out."""
    tasks, records = _table1(args) if any(args.runs.glob("*--*.json")) else ([], [])
    outcomes = read_outcomes(args.basin) if (args.basin / BASIN_FILE).is_file() else []
    flights = read_flights(args.drone) if args.drone.is_dir() else []
    if not (records or outcomes or flights):
        folders = f"{args.runs}, {args.basin} and {args.drone}"
        raise ConfigError(
            f"{folders} hold no trials of these tasks", "what table1, basin or drone has run"
        )
    return Contents(tasks, records, outcomes, flights, _depth_bundle(args))


def _depth_bundle(args: argparse.Namespace) -> str | None:
    """The depth bundle that is named, checked, or the default one where there is one."""
    if args.depth_bundle is not None:
        load_depth_network(args.depth_bundle, threads=1)  # refuses at once what cannot be used
        return str(args.depth_bundle)
    return DEFAULT_DEPTH if bundle_folder(DEFAULT_DEPTH).is_dir() else None


def _table1(args: argparse.Namespace) -> tuple[list[BenchTask], list[TrialRecord]]:
    records = read_records(args.runs)
    tasks = own_tasks(args) or default_tasks()
    poses = {task.name: task.poses for task in tasks}
    ours = [
        record
        for record in records
        if record.task in poses and same_poses((record.start, record.goal), poses[record.task])
    ]
    if len(ours) < len(records):
        log(f"{len(records) - len(ours)} trials in {args.runs} are of other tasks: left out")
    unknown = sorted({record.method for record in ours} - set(METHODS))
    if unknown:
        known = [record for record in ours if record.method in METHODS]
        log(
            f"{len(ours) - len(known)} trials in {args.runs} are of methods that are not known "
            f"here ({', '.join(unknown)}): left out; run the report by the file that adds them"
        )
        ours = known
    return tasks, ours
