"""``dfvs-bench scenes``: make the ten scenes of the benchmark, and look at them."""

from __future__ import annotations

import argparse
import sys
import time
from pathlib import Path
from typing import Any

from dfvs_core.errors import ConfigError
from dfvs_core.wire.picture import encode_png
from dfvs_sim.bench.contact_sheet import contact_sheet
from dfvs_sim.bench.scenes import SCENES, TASKS_FILE, cache_folder, make_scenes
from dfvs_sim.scene.light import BakeSettings, load_mitsuba

_EPILOG = """examples:
  dfvs-bench scenes --out bench-scenes --sheet scenes.png
  dfvs-bench scenes --light traced --out traced --sheet traced.png
"""


def add_parser(subparsers: Any) -> None:
    """Add ``scenes`` to the subcommands of ``dfvs-bench``."""
    parser = subparsers.add_parser(
        "scenes",
        help="make the ten scenes and their tasks",
        description="Make ten rooms of ten kinds from seeds (GLB) and a task in each: start, goal "
        "and intrinsics in tasks.json. Takes minutes; rooms that are there are kept. Traced light "
        "takes much longer and Mitsuba 3 (the extra [bake]); it goes into a folder of its own, "
        "with the same tasks.",
        epilog=_EPILOG,
        formatter_class=argparse.RawDescriptionHelpFormatter,
    )
    add = parser.add_argument
    add("--out", type=Path, metavar="DIR", help=f"default: {cache_folder()}, where table1 looks")
    add("--light", choices=("quick", "traced"), default="quick", help="default: quick")
    add("--samples", type=int, default=256, metavar="N", help="traced light paths a vertex")
    add("--sheet", type=Path, metavar="FILE.png", help="start and goal of each as one picture")
    parser.set_defaults(run=run)


def run(args: argparse.Namespace) -> int:
    """Make the scenes; exit code 0.

    Raises
    ------
    DfvsError
        If an output cannot be written or no task fits into a room.
    """
    if args.sheet is not None and not args.sheet.absolute().parent.is_dir():
        raise ConfigError(f"--sheet {args.sheet} lies in no folder", "an existing folder")
    if args.sheet is not None and args.sheet.suffix.lower() != ".png":
        raise ConfigError(f"--sheet is {str(args.sheet)!r}", "a name that ends in .png")
    started = time.monotonic()

    def tell(text: str) -> None:
        elapsed_s = time.monotonic() - started
        print(f"{elapsed_s:5.0f} s  {text}", file=sys.stderr, flush=True)

    folder = args.out or cache_folder()
    tasks = make_scenes(folder, SCENES, tell, _traced(args))
    took_s = time.monotonic() - started
    print(f"wrote {folder / TASKS_FILE} and {len(tasks)} scenes in {took_s:.0f} s")
    if args.sheet is not None:
        args.sheet.write_bytes(encode_png(contact_sheet(tasks)))
        print(f"wrote {args.sheet}")
    return 0


def _traced(args: argparse.Namespace) -> BakeSettings | None:
    """Settings of traced light, if it is asked for and can be had."""
    if args.light == "quick":
        return None
    if args.out is None:
        raise ConfigError("--light traced has no folder", "--out DIR", "then table1 --tasks")
    load_mitsuba()
    return BakeSettings(samples=args.samples)
