"""``dfvs-bench scenes``: the ten scenes of the benchmark, to look at or to make anew."""

import argparse
import math
import time
from pathlib import Path
from typing import Any

from dfvs_bench.report.contact_sheet import contact_sheet
from dfvs_bench.trials.scenes import SCENES, TASKS_FILE, default_tasks, make_scenes
from dfvs_bench.trials.settings import SETTINGS, setting_tasks
from dfvs_bench.trials.task import BenchTask
from dfvs_common.command_line import require_file
from dfvs_common.progress import log
from dfvs_core.errors import ConfigError
from dfvs_core.messages.image import encode_png
from dfvs_rooms.lighting.path_traced import BakeSettings, load_mitsuba

_EPILOG = """examples:
  dfvs-bench scenes --sheet scenes.png
  dfvs-bench scenes --out anew --light traced --sheet anew.png
  dfvs-bench scenes --setting planar --share 0.5 --out planar

settings, of learned pose regression:
""" + "\n".join(f"  {name:<7} {setting.summary}" for name, setting in SETTINGS.items())


def add_parser(subparsers: Any) -> None:
    """Add ``scenes`` to the subcommands of ``dfvs-bench``."""
    parser = subparsers.add_parser(
        "scenes",
        help="the ten scenes and their tasks, to look at or to make anew",
        description="List the ten scenes that come with the package. With --out, make them anew: "
        "ten rooms of ten kinds from seeds (GLB), a task in each, and start, goal and intrinsics "
        "in tasks.json, for --tasks. Quick light takes a minute or two; traced light, that of "
        "those that come with the package, a quarter of an hour and Mitsuba 3 (extra [bake]). "
        "Rooms that are in the folder already are kept.",
        epilog=_EPILOG,
    )
    add = parser.add_argument
    add("--out", type=Path, metavar="DIR", help="make the scenes anew, into this folder")
    add("--light", choices=("quick", "traced"), default="quick", help="of --out (default: quick)")
    add("--samples", type=int, default=512, metavar="N", help="traced light paths a vertex")
    add("--setting", choices=tuple(SETTINGS), help="tasks of this setting into --out instead")
    add("--share", type=float, metavar="S", help="of the setting's displacement, 0 to 1")
    add("--sheet", type=Path, metavar="FILE.png", help="start and goal of each as one image")
    parser.set_defaults(run=run)


def run(args: argparse.Namespace) -> int:
    """List or make the scenes; exit code 0."""
    require_file("--sheet", args.sheet, ".png")
    tasks = _tasks(args)
    print("\n".join(_line(task) for task in tasks))
    if args.sheet is not None:
        args.sheet.write_bytes(encode_png(contact_sheet(tasks)))
        print(f"wrote {args.sheet}")
    return 0


def _tasks(args: argparse.Namespace) -> list[BenchTask]:
    traced = _traced(args)
    if args.setting is None and args.share is not None:
        raise ConfigError("--share without a setting", "--setting")
    if args.setting is not None:
        if args.out is None or traced is not None:
            raise ConfigError("--setting without --out, or with --light traced", "--out DIR alone")
        return setting_tasks(args.setting, args.share, args.out)
    return default_tasks() if args.out is None else _made(args.out, traced)


def _made(folder: Path, traced: BakeSettings | None) -> list[BenchTask]:
    started = time.monotonic()

    def tell(text: str) -> None:
        elapsed_s = time.monotonic() - started
        log(f"{elapsed_s:5.0f} s  {text}")

    tasks = make_scenes(folder, SCENES, tell, traced)
    took_s = time.monotonic() - started
    print(f"wrote {folder / TASKS_FILE} and {len(tasks)} scenes in {took_s:.0f} s")
    return tasks


def _line(task: BenchTask) -> str:
    distance_m, angle_rad = task.initial_error
    start = f"{distance_m:.2f} m {math.degrees(angle_rad):4.1f}°"
    return f"{task.name:<12} {task.difficulty:<7} {start}  {task.scene}"


def _traced(args: argparse.Namespace) -> BakeSettings | None:
    """Settings of traced light, if it is asked for and can be had."""
    if args.light == "quick":
        return None
    if args.out is None:
        raise ConfigError("--light traced has no folder", "--out DIR", "then table1 --tasks")
    load_mitsuba()
    return BakeSettings(samples=args.samples)
