"""Options that the measuring commands of ``dfvs-bench`` share: tasks, workers, outputs."""

import argparse
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import TypeVar

from dfvs_bench.methods.registry import METHODS, POSE_NETWORKS, chosen_methods, with_bundles
from dfvs_bench.trials.executor import TrialExecutor
from dfvs_bench.trials.perturbation import Perturbation
from dfvs_bench.trials.provenance import git_revision
from dfvs_bench.trials.results import TrialRecord, write_record
from dfvs_bench.trials.run import Countdown, Job, run_job, unfinished
from dfvs_bench.trials.scenes import ASSETS, default_tasks, task_in
from dfvs_bench.trials.tables import trial_line
from dfvs_bench.trials.task import BenchTask, read_tasks
from dfvs_common.command_line import require_file, require_folder, require_range
from dfvs_common.progress import log
from dfvs_core.errors import ConfigError
from dfvs_core.matching.matcher import LEAST_SIZE_PX
from dfvs_models import DEFAULT_DEPTH, DEFAULT_MATCHER
from dfvs_models.catalog import load_matcher
from dfvs_sim.scene.glb import load_glb

_T = TypeVar("_T")


def add_task_options(parser: argparse.ArgumentParser, tasks_help: str, runs: str) -> None:
    """Add what every measurement takes: tasks, matcher, and where results go."""
    add_own_scenes(parser, tasks_help)
    add = parser.add_argument
    add("--scenes", metavar="A,B", help="names of the scenes to use (default: all)")
    add("--bundle", default=DEFAULT_MATCHER, metavar="NAME", help="matcher: see dfvs-bench flow")
    add("--runs", type=Path, default=Path(runs), metavar="DIR", help=f"default: {runs}")
    add("--resume", action="store_true", help="keep what is in --runs and fits")
    add("--json", type=Path, metavar="FILE", help="write a summary")
    add("--csv", type=Path, metavar="FILE", help="write a row for every trial")


def add_own_scenes(parser: argparse.ArgumentParser, tasks_help: str) -> None:
    """Add ``--tasks`` and ``--scene``."""
    add = parser.add_argument
    add("--tasks", type=Path, metavar="FILE", help=tasks_help)
    add(
        "--scene",
        type=Path,
        action="append",
        metavar="FILE.glb",
        help="anybody's scene: a task is drawn in it (1.5 m, 20°; the basin draws its own); may "
        "be repeated",
    )


def add_trial_options(
    parser: argparse.ArgumentParser, tasks_help: str, runs: str, methods: Sequence[str]
) -> None:
    """Add what runs of trials take: tasks, ``--workers``, ``--dask``, methods and networks."""
    add_task_options(parser, tasks_help, runs)
    add = parser.add_argument
    add("--workers", type=int, default=1, metavar="N", help="processes (default: 1)")
    add("--dask", metavar="ADDRESS", help="scheduler of a Dask cluster to use instead")
    add("--methods", metavar="A,B", help=f"default: {','.join(methods)}")
    add("--iterations", type=int, metavar="N", help="for every method (default: its authors')")
    add(
        "--depth-bundle",
        default=DEFAULT_DEPTH,
        metavar="NAME",
        help=f"depth network of network-depth and fused-depth (default: {DEFAULT_DEPTH})",
    )
    for name in POSE_NETWORKS:
        shipped = ASSETS / name
        default, where = (str(shipped), " (default: shipped)") if shipped.is_dir() else (name, "")
        add(f"--{name}-bundle", default=default, metavar="NAME", help=f"network of {name}{where}")


def _networks_from(args: argparse.Namespace) -> dict[str, str]:
    """Bundles that are named, by ``MethodKind.network``."""
    return {name: getattr(args, f"{name}_bundle") for name in ("depth", *POSE_NETWORKS)}


def trial_setup(
    args: argparse.Namespace, default: Sequence[str], *outputs: str
) -> tuple[TrialExecutor, list[str]]:
    """Executor, and methods of ``--methods`` or the default ones whose networks there are.

    Outputs, iterations and models are checked before anything runs.

    Raises
    ------
    DfvsError
        If an option cannot be used, or the matcher or the network of a method not be loaded.
    """
    check_outputs(args, *outputs)
    require_range(args, 1, None, "iterations")
    executor = TrialExecutor(args.workers, args.dask)
    networks = _networks_from(args)
    kinds = chosen_methods(
        args.methods.split(",") if args.methods else with_bundles(default, networks)
    )
    for kind in kinds.values():
        kind.load(networks[kind.network] if kind.network else None)
    load_matcher(args.bundle, threads=1)
    return executor, list(kinds)


def add_pairs_options(parser: argparse.ArgumentParser, threads_for: str) -> None:
    """Add what measurements on image pairs take: files, ``--threads`` and ``--json``."""
    add = parser.add_argument
    add("pairs", type=Path, nargs="+", metavar="PAIRS.npz")
    add("--threads", type=int, default=2, help=f"threads for {threads_for} (default: 2)")
    add("--json", type=Path, metavar="FILE", help="write the figures as JSON, too")


def check_pairs_options(args: argparse.Namespace) -> None:
    """Refuse a number of threads and an output that cannot be."""
    require_range(args, 1, 64, "threads")
    require_file("--json", args.json)


def check_outputs(args: argparse.Namespace, *more: str) -> None:
    """Refuse outputs that lie in no folder, before anything runs."""
    for name in ("json", "csv", *more):
        require_file(f"--{name}", getattr(args, name))
    require_folder("--runs", args.runs)
    if args.runs is not None and args.runs.exists() and not args.runs.is_dir():
        raise ConfigError(f"--runs {args.runs} is a file", "a folder, or a new name")


def tasks_from(args: argparse.Namespace) -> list[BenchTask]:
    """Tasks of ``--tasks`` or ``--scene``, or of the ten scenes; those that ``--scenes`` names.

    Raises
    ------
    DfvsError
        If the file cannot be used, or a name is not known.
    """
    own = own_tasks(args)
    tasks = named(own or default_tasks(), args.scenes, lambda task: task.name)
    if own:
        check_tasks(tasks)
    return tasks


def check_tasks(tasks: Sequence[BenchTask]) -> None:
    """Refuse tasks that could not be tried, before any is: hours may lie between them.

    Raises
    ------
    DfvsError
        If a scene cannot be read, or images are too small to be matched.
    """
    for task in tasks:
        if min(task.camera.size) < LEAST_SIZE_PX:
            width, height = task.camera.size
            raise ConfigError(
                f"task {task.name!r} has pictures of {width} x {height} px",
                f"{LEAST_SIZE_PX} x {LEAST_SIZE_PX} or more",
            )
    for scene in dict.fromkeys(task.scene for task in tasks):
        load_glb(scene)


def own_tasks(args: argparse.Namespace) -> list[BenchTask]:
    """Tasks of ``--tasks`` and ``--scene``; none where neither is given.

    Raises
    ------
    DfvsError
        If a file cannot be used, or two tasks have one name.
    """
    tasks = read_tasks(args.tasks) if args.tasks else []
    scenes = own_scenes(args, [task.name for task in tasks])
    return tasks + [task_in(scene) for scene in scenes]


def own_scenes(args: argparse.Namespace, taken: Sequence[str]) -> list[Path]:
    """Files of ``--scene``, which go by their names without the ending.

    Raises
    ------
    ConfigError
        If there is no such file, or two have one name or one of those ``taken``.
    """
    scenes: list[Path] = list(args.scene or ())
    for scene in scenes:
        if scene.suffix.lower() != ".glb" or not scene.is_file():
            raise ConfigError(f"--scene {scene} is no GLB file", "a file; --scenes takes names")
    check_names(scenes, taken)
    return scenes


def check_names(scenes: Sequence[Path], taken: Sequence[str] = ()) -> None:
    """Refuse scenes whose names without the ending are not unique, or are ``taken``."""
    names = [*taken, *(scene.stem for scene in scenes)]
    if len(set(names)) < len(names):
        raise ConfigError(f"tasks are named {', '.join(names)}", "names of their own")


def named(items: Sequence[_T], names: str | None, name_of: Callable[[_T], str]) -> list[_T]:
    """Those of the items that are named, separated by commas, in that order; or all.

    Raises
    ------
    ConfigError
        If a name is not known.
    """
    if not names:
        return list(items)
    known = {name_of(item): item for item in items}
    chosen = list(dict.fromkeys(names.split(",")))
    for name in chosen:
        if name not in known:
            raise ConfigError(f"there is no scene {name!r}", f"some of {', '.join(known)}")
    return [known[name] for name in chosen]


def run_trials(
    args: argparse.Namespace,
    executor: TrialExecutor,
    tasks: Sequence[BenchTask],
    methods: Sequence[str],
    perturbations: Sequence[Perturbation] = (),
) -> list[TrialRecord]:
    """Make the trials that ``--resume`` does not find in ``--runs``; all records, old and new."""
    jobs = _jobs(args, tasks, methods, perturbations)
    left, records = unfinished(jobs, args.runs) if args.resume else (jobs, [])
    if records:
        log(f"{len(records)} trials are in {args.runs}")
    countdown = Countdown(len(left))
    try:
        for record in executor.finished(run_job, left):
            write_record(args.runs, record)
            records.append(record)
            log(f"{trial_line(record)} {countdown.step()}")
    except (KeyboardInterrupt, SystemExit):
        log(f"interrupted: {len(records)} trials are in {args.runs}; --resume goes on")
        raise
    return records


def _jobs(
    args: argparse.Namespace,
    tasks: Sequence[BenchTask],
    methods: Sequence[str],
    perturbations: Sequence[Perturbation],
) -> list[Job]:
    """All trials, scene by scene; each perturbation is tried as well as none."""
    revision, networks = git_revision(), _networks_from(args)
    return [
        Job(
            task,
            name,
            args.bundle,
            args.iterations or METHODS[name].iterations,
            revision,
            networks[METHODS[name].network] if METHODS[name].network else None,
            perturbation,
        )
        for task in tasks
        for perturbation in (None, *perturbations)
        for name in methods
    ]
