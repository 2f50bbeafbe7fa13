"""``dfvs-bench drone``: the tasks flown by the simulated vehicle through the real service."""

import argparse
import time
from collections.abc import Sequence
from pathlib import Path
from typing import Any

from dfvs_bench.drone.flights import fly
from dfvs_bench.drone.levelled import levelled_task
from dfvs_bench.drone.limits import depth_network, velocity_limits
from dfvs_bench.drone.records import (
    FlightRecord,
    Setting,
    fits,
    read_record,
    record_path,
    write_record,
)
from dfvs_bench.drone.tables import HEADER, flight_line, row, summarise, summary_line
from dfvs_bench.options import add_task_options, check_outputs, tasks_from
from dfvs_bench.trials.provenance import git_revision, run_facts
from dfvs_bench.trials.run import Countdown
from dfvs_bench.trials.tables import write_rows
from dfvs_bench.trials.task import BenchTask
from dfvs_common.command_line import require_range
from dfvs_common.lifecycle import EXIT_FAILED, EXIT_OK
from dfvs_core.errors import ConfigError
from dfvs_models.catalog import load_depth_network, load_matcher
from dfvs_sim.demo.flight.service_settings import settings_in_force
from dfvs_sim.demo.options import (
    FlightOptions,
    add_autopilot_options,
    add_condition_options,
    check_autopilot,
    conditions_from,
)
from dfvs_sim.demo.progress import Progress
from dfvs_sim.demo.results.summary import NOT_READY
from dfvs_sim.options import write_json

_EPILOG = """examples:
  dfvs-bench drone --json drone.json --csv drone.csv
  dfvs-bench drone --scenes hall --set limits.horizontal_m_s=0.3 --runs slow-runs
  dfvs-bench drone --autopilot udpin://127.0.0.1:14540 --runs px4-runs

Every task is flown in real time, one after the other, as dfvs-demo flies: vehicle, camera, pilot
and service are processes of their own. Start and goal are levelled: place and heading stay, roll
and pitch are left out, and the goal image is taken anew from the level goal. A flight has
converged if the service says DONE and the camera truly is within 5 cm and 1 degree. Its time is
set against the least that the straight line takes under the limits in force. A flight that cannot
be brought up is told as NOT READY with its cause; the others are flown, and the exit code is 1.
--resume keeps the flights in --runs that were made with the same settings and autopilot.
"""


def add_parser(subparsers: Any) -> None:
    """Add ``drone`` to the subcommands of ``dfvs-bench``."""
    parser = subparsers.add_parser(
        "drone",
        help="the tasks flown by the simulated vehicle through the real service",
        description="Fly the benchmark's tasks with four degrees of freedom: final errors, and the "
        "time against the bound of a straight flight at the limits.",
        epilog=_EPILOG,
    )
    add_task_options(parser, "tasks.json (default: the ten scenes)", "drone-runs")
    add = parser.add_argument
    add("--seed", type=int, default=0, metavar="N", help="noise of camera and vehicle (default: 0)")
    add("--timeout", type=float, default=60.0, metavar="S", help="give up a flight after so long")
    add("--ready", type=float, default=40.0, metavar="S", help="wait so long for the service")
    add_condition_options(parser)
    add_autopilot_options(parser)
    add("--config", type=Path, metavar="FILE", help="settings of dfvs-service")
    add(
        "--set",
        action="append",
        default=[],
        metavar="SECTION.KEY=VALUE",
        help="a setting of dfvs-service; may be repeated",
    )
    parser.set_defaults(run=run)


def run(args: argparse.Namespace) -> int:
    """Fly what is to be flown, print the table and write; 1 where one could not be brought up."""
    _check(args)
    load_matcher(args.bundle, threads=1)  # refuses at once what cannot be used
    tasks = [levelled_task(task) for task in tasks_from(args)]
    setting = _setting(args)
    if setting.network is not None:
        load_depth_network(setting.network, threads=1)
    args.runs.mkdir(parents=True, exist_ok=True)
    began_s = time.monotonic()
    kept = _kept(args.runs, tasks, setting) if args.resume else {}
    progress = Progress()
    if kept:
        progress.log(f"{len(kept)} flights are in {args.runs}")
    countdown = Countdown(len(tasks) - len(kept))
    for task in tasks:
        if task.name not in kept:
            progress.log(f"{task.name}:")
            record = fly(task, setting, args.runs.absolute() / task.name, progress)
            write_record(args.runs, record)
            kept[task.name] = record
            progress.log(f"{flight_line(record)} {countdown.step()}")
    records = [kept[task.name] for task in tasks]
    _finish(args, records, time.monotonic() - began_s)
    return EXIT_FAILED if any(r.end_state == NOT_READY for r in records) else EXIT_OK


def _check(args: argparse.Namespace) -> None:
    check_outputs(args)
    if args.json is not None and args.json.resolve().parent == args.runs.resolve():
        raise ConfigError(
            f"--json {args.json} lies in --runs, where a JSON file is a flight", "another folder"
        )
    for name in ("timeout", "ready"):
        if not 0 < getattr(args, name) <= 3600:
            raise ConfigError(f"--{name} is {getattr(args, name):g} s", "above 0, to 3600")
    require_range(args, 0, None, "seed")
    check_autopilot(args)
    if any(text.startswith("flow.model=") for text in args.set):
        raise ConfigError("--set names flow.model", "--bundle for the matcher")


def _setting(args: argparse.Namespace) -> Setting:
    service = tuple(word for text in args.set for word in ("--set", text))
    if args.config is not None:
        service = ("--config", str(args.config.absolute()), *service)
    settings = settings_in_force(service)
    options = FlightOptions(
        timeout_s=args.timeout,
        ready_s=args.ready,
        system_id=args.system_id,
        autopilot=args.autopilot,
        ground=args.ground,
        conditions=conditions_from(args),
        service=("--set", f"flow.model={args.bundle}", *service),
    )
    limits, network = velocity_limits(settings), depth_network(settings)
    own = (args.bundle, service, limits, args.seed, git_revision())
    return Setting(*own, options, args.config, network)


def _kept(folder: Path, tasks: Sequence[BenchTask], setting: Setting) -> dict[str, FlightRecord]:
    """Records of the tasks that were flown already with these settings."""
    paths = {task.name: record_path(folder, task.name) for task in tasks}
    found = {name: read_record(path) for name, path in paths.items() if path.is_file()}
    return {
        task.name: found[task.name]
        for task in tasks
        if task.name in found and fits(found[task.name], task, setting)
    }


def _finish(args: argparse.Namespace, records: list[FlightRecord], wall_s: float) -> None:
    summary = summarise(records)
    print(HEADER)
    for record in records:
        print(flight_line(record))
    print(summary_line(summary))
    if args.json is not None:
        document = {"methods": {"service": summary}, "matcher": args.bundle, "seed": args.seed}
        document |= {name: getattr(records[0], name) for name in ("estimate", "wind", "autopilot")}
        write_json(args.json, document | run_facts((r.revision for r in records), wall_s))
    if args.csv is not None:
        write_rows(args.csv, [row(record) for record in records])
