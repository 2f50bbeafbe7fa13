"""``dfvs-bench basin``: from how far away servoing converges, as in the paper's Fig. 6."""

import argparse
import time
from collections.abc import Sequence
from pathlib import Path
from typing import Any

from dfvs_bench.basin.cells import ROTATIONS_DEG, TRANSLATIONS_M, Cell
from dfvs_bench.basin.drawing import LEAST_OVERLAP, DrawRequest
from dfvs_bench.basin.environments import (
    BATCH,
    Environment,
    default_environments,
    environments_in,
    environments_of,
    make_missing,
)
from dfvs_bench.basin.outcomes import BASIN_FILE, Outcome, draw_tasks, read_outcomes
from dfvs_bench.basin.ratios import summarise, summary_lines, tidy_row
from dfvs_bench.options import add_trial_options, named, own_scenes, run_trials, trial_setup
from dfvs_bench.report.basin_figure import basin_figure
from dfvs_bench.report.figures import figure_format
from dfvs_bench.trials.provenance import run_facts
from dfvs_bench.trials.tables import write_rows
from dfvs_bench.trials.task import read_tasks
from dfvs_common.command_line import require_range
from dfvs_common.progress import log
from dfvs_core.errors import ConfigError
from dfvs_sim.options import parse_numbers, write_json

DEFAULT_METHODS = ("flow-depth", "motion-depth", "motion-depth-search")
"""What the paper's Fig. 6 shows, what flies, and the same on a camera that may look around."""

_MOST_TRIALS = 10_000
_EPILOG = f"""examples:
  dfvs-bench basin --workers 2 --json basin.json --csv basin.csv --plot basin.png
  dfvs-bench basin --rotations 20,20,40 --translations 0.4,2,4 --methods true-depth --resume
  dfvs-bench basin --tasks my_tasks.json --trials 32 --dask tcp://127.0.0.1:8786

A trial starts somewhere in free space, displaced from the goal by a translation and a rotation
set, and converges if it ends within 4 cm and 1 degree. A batch is {BATCH} rooms from seeds, made
on the first call (minutes); --tasks takes scenes and intrinsics of a task file instead. Ratios
are given twice: over all tasks, and over as many tasks whose start sees {LEAST_OVERLAP:.0%} of the
goal's pixels. --resume keeps the tasks and trials in --runs. A call for other cells or scenes
replaces the tasks there, and the trials of the former ones no longer count.
"""


def add_parser(subparsers: Any) -> None:
    """Add ``basin`` to the subcommands of ``dfvs-bench``."""
    parser = subparsers.add_parser(
        "basin",
        help="convergence ratio against initial translation and rotation",
        description="Lead a free camera to goals from further and further away, and tell how often "
        "each method converges, with 95 % intervals (DFVS Fig. 6).",
        epilog=_EPILOG,
    )
    tasks_help = "tasks.json: its scenes (default: sixteen rooms)"
    add_trial_options(parser, tasks_help, "basin-runs", DEFAULT_METHODS)
    add = parser.add_argument
    add("--trials", type=int, default=BATCH, metavar="N", help=f"of each cell (default: {BATCH})")
    add("--seed", type=int, default=0, metavar="N", help="draws goals and starts (default: 0)")
    add("--translations", metavar="A,B", help="m per axis (default: 0.4,0.8,...,4)")
    add(
        "--rotations",
        nargs="+",
        metavar="X,Y,Z",
        help="degrees (default: 10,10,25 20,20,40 30,30,50)",
    )
    add("--plot", type=Path, metavar="FILE", help="Fig. 6 as .png, .svg or .pdf")
    parser.set_defaults(run=run)


def run(args: argparse.Namespace) -> int:
    """Run what is to be run, print the ratios and write the files; exit code 0."""
    _check(args)
    began_s = time.monotonic()
    executor, methods = trial_setup(args, DEFAULT_METHODS, "plot")
    cells = cells_from(args)
    environments = _environments(args)
    args.runs.mkdir(parents=True, exist_ok=True)
    drawn = draw_tasks(_requests(args, environments, cells), args.runs, executor, log)
    by_name = {place.name: place for place in environments}
    tasks = [task.task(by_name[task.environment]) for task in drawn]
    records = run_trials(args, executor, tasks, methods)
    _finish(args, read_outcomes(args.runs, records), time.monotonic() - began_s)
    return 0


def _check(args: argparse.Namespace) -> None:
    require_range(args, 1, _MOST_TRIALS, "trials")
    require_range(args, 0, None, "seed")
    if args.plot is not None:
        figure_format("--plot", args.plot)


def cells_from(args: argparse.Namespace) -> tuple[Cell, ...]:
    """Every translation with every rotation set, set by set.

    Raises
    ------
    ConfigError
        If one of them is none.
    """
    rotations: list[tuple[float, ...]] = list(ROTATIONS_DEG)
    if args.rotations:
        expected = "three angles in degrees such as 20,20,40"
        rotations = [parse_numbers(t, "--rotations", 3, expected) for t in args.rotations]
    translations: tuple[float, ...] = TRANSLATIONS_M
    if text := args.translations:
        count, expected = text.count(",") + 1, "numbers separated by commas"
        translations = parse_numbers(text, "--translations", count, expected)
    pairs = [(t, r) for r in dict.fromkeys(rotations) for t in dict.fromkeys(translations)]
    return tuple(Cell(translation, (x, y, z)) for translation, (x, y, z) in pairs)


def _environments(args: argparse.Namespace) -> list[Environment]:
    """Scenes that are given, or the sixteen rooms, which are made if they are missing."""
    own = environments_of(read_tasks(args.tasks)) if args.tasks else []
    own += environments_in(own_scenes(args, [place.name for place in own]))
    chosen = named(own or default_environments(), args.scenes, lambda place: place.name)
    if not own:
        make_missing(chosen, log)
    return chosen


def _requests(
    args: argparse.Namespace, environments: Sequence[Environment], cells: tuple[Cell, ...]
) -> list[DrawRequest]:
    """What is to be drawn in each environment; without ``--resume`` nothing drawn is kept."""
    each, rest = divmod(args.trials, len(environments))
    requests = [
        DrawRequest(place, cells, each + (k < rest), args.seed)
        for k, place in enumerate(environments)
    ]
    requests = [request for request in requests if request.count]
    log(f"{len(cells)} cells of {args.trials} trials, in {len(requests)} environments")
    if not args.resume:
        (args.runs / BASIN_FILE).unlink(missing_ok=True)
    return requests


def _finish(args: argparse.Namespace, outcomes: list[Outcome], wall_s: float) -> None:
    if not outcomes:
        raise ConfigError("no start was found in any environment", "larger scenes, or nearer cells")
    outcomes.sort(key=lambda o: (o.record.method, o.drawn.name))
    print("\n".join([*summary_lines(outcomes), "", f"this run took {wall_s / 60:.1f} min"]))
    if args.json is not None:
        document = summarise(outcomes) | {"seed": args.seed, "trials": args.trials}
        facts = run_facts((o.record.revision for o in outcomes), wall_s)
        write_json(args.json, document | {"matcher": args.bundle} | facts)
    if args.csv is not None:
        write_rows(args.csv, [tidy_row(outcome) for outcome in outcomes])
    if args.plot is not None:
        args.plot.write_bytes(basin_figure(outcomes, figure_format("--plot", args.plot)))
        print(f"wrote {args.plot}")
