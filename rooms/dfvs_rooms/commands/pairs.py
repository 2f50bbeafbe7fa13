"""``dfvs-rooms pairs``: pairs of views with exact flow, to measure by and to train on."""

import argparse
import functools
import json
import sys
import time
import zlib
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Any

import numpy as np

from dfvs_common.command_line import require_range
from dfvs_common.progress import log
from dfvs_core.errors import ConfigError
from dfvs_models.evaluation import LEVELS
from dfvs_rooms.generator.interior import KINDS, drawn_interior
from dfvs_rooms.generator.splits import BENCHMARK_SEEDS, require_training
from dfvs_rooms.lighting.bake import light_room
from dfvs_rooms.pairs.evaluation import PairSampler, ViewPair, evaluation_arrays, write_arrays
from dfvs_rooms.pairs.wide import WidePairSampler
from dfvs_rooms.room_types.room_types import ROOM_KINDS, room_of_kind
from dfvs_sim.options import parse_seeds
from dfvs_sim.render.renderer import Renderer
from dfvs_sim.scene.glb import load_glb
from dfvs_sim.scene.mesh import Scene

_MAX_PAIRS = 1_000_000
_EPILOG = """examples:
  dfvs-rooms pairs --scene room.glb --count 45 --seed 1 --out room.npz
  dfvs-rooms pairs --format wide --rooms 30000-30089 --kinds all --count 40 --seed 0 --out pairs
"""


def add_parser(subparsers: Any) -> None:
    """Add ``pairs`` to the subcommands of ``dfvs-rooms``."""
    parser = subparsers.add_parser(
        "pairs",
        help="pairs of views with exact flow",
        description="Render pairs of views of rooms: a file of small, medium and large motions in "
        "turn with exact flow for dfvs-bench, or a folder of wide-baseline pairs with depth and "
        "pose, a file a room, for dfvs-export train. The seed and the rooms decide every bit.",
        epilog=_EPILOG,
    )
    add = parser.add_argument
    rooms = parser.add_mutually_exclusive_group(required=True)
    rooms.add_argument(
        "--rooms", metavar="A-B", help="interiors drawn from the seeds A to B, quickly lit"
    )
    rooms.add_argument(
        "--scene", type=Path, nargs="+", metavar="FILE.glb", help="scenes to look around in"
    )
    add(
        "--kinds",
        metavar="A,B",
        help=f"kinds of rooms, drawn by the seed, or 'all': {', '.join(ROOM_KINDS)} "
        f"(default: {', '.join(KINDS)})",
    )
    add("--format", choices=("eval", "wide"), default="eval", help="default: eval")
    add("--count", type=int, required=True, metavar="N", help="pairs (wide: of each room)")
    add("--seed", type=int, required=True, help="decides the views")
    add("--out", type=Path, required=True, help="evaluation file (.npz), or folder to add to")
    add("--json", action="store_true", help="print what was written as JSON")
    parser.set_defaults(run=run)


def run(args: argparse.Namespace) -> int:
    """Draw and write the pairs; exit code 0."""
    require_range(args, 1, _MAX_PAIRS, "count")
    require_range(args, 0, None, "seed")
    write = _write_wide if args.format == "wide" else _write_file
    written = write(args, _scenes(args))
    report = {"pairs": sum(written.values()), "files": [str(path) for path in written]}
    if args.json:
        print(json.dumps(report, indent=2))
    else:
        print(f"wrote {report['pairs']} pairs in {len(written)} files to {args.out}")
    return 0


_Scenes = dict[str, Callable[[], Scene]]
"""Maker of the scene of each room by name; it is made when its turn comes."""


def _scenes(args: argparse.Namespace) -> _Scenes:
    kinds = _kinds(args.kinds)
    if args.scene is not None:
        if args.kinds is not None:
            raise ConfigError("--kinds was given with --scene", "--kinds with --rooms")
        names = [path.stem for path in args.scene]
        if len(set(names)) < len(names):
            raise ConfigError(f"scenes are named {', '.join(names)}", "names of their own")
        return {path.stem: functools.partial(load_glb, path) for path in args.scene}
    seeds = parse_seeds(args.rooms, "--rooms", "seeds such as 1000-1031")
    if seeds[0] <= BENCHMARK_SEEDS[-1] and seeds[-1] >= BENCHMARK_SEEDS[0]:
        raise ConfigError(
            f"--rooms is {args.rooms!r}",
            f"other seeds than {BENCHMARK_SEEDS[0]} to {BENCHMARK_SEEDS[-1]}, the benchmark's own",
        )
    if args.format == "wide":
        require_training(seeds[0], seeds[-1])
    return {str(seed): functools.partial(_lit_room, seed, kinds) for seed in seeds}


def _kinds(words: str | None) -> tuple[str, ...]:
    """Kinds of rooms of ``A,B``; none where nothing is said."""
    if words is None:
        return ()
    kinds = ROOM_KINDS if words == "all" else tuple(words.split(","))
    for kind in kinds:
        if kind not in ROOM_KINDS:
            raise ConfigError(f"no kind of room {kind!r}", f"'all', or of {', '.join(ROOM_KINDS)}")
    return kinds


def _lit_room(seed: int, kinds: tuple[str, ...]) -> Scene:
    """Room of one of the kinds, quickly lit; the seed decides on all of it."""
    if kinds:
        drawn = int(np.random.default_rng([seed, 6]).integers(len(kinds)))
        room = room_of_kind(kinds[drawn], seed)
    else:
        room = drawn_interior(seed)
    return light_room(room, seed)


def _write_wide(args: argparse.Namespace, scenes: _Scenes) -> dict[Path, int]:
    """Write a file of wide-baseline pairs for each room; those that exist are kept and counted.

    A room without any pair gets no file, and is named.
    """
    try:
        args.out.mkdir(parents=True, exist_ok=True)
    except OSError as error:
        raise ConfigError(f"{args.out} cannot be made ({error})", "a folder") from error
    if kept := sum((args.out / f"{name}.npz").exists() for name in scenes):
        log(f"{kept} files in {args.out} are kept as they are: name a new folder for others")
    written: dict[Path, int] = {}
    without = []
    started = time.monotonic()
    for k, (name, scene) in enumerate(scenes.items()):
        path = args.out / f"{name}.npz"
        if not path.exists():
            sampler = WidePairSampler(Renderer(scene()), zlib.crc32(name.encode()) ^ args.seed)
            arrays = sampler.arrays(args.count)
            if len(arrays["T"]):
                write_arrays(path, arrays)
                written[path] = len(arrays["T"])
            else:
                without.append(name)
        _show_progress(k + 1, len(scenes), "rooms", started)
    if without:
        log(f"no pair of views was found in {', '.join(without)}: no file was written")
    return written


def _write_file(args: argparse.Namespace, scenes: _Scenes) -> dict[Path, int]:
    """Write an evaluation file; the rooms and the levels take turns."""
    if args.out.suffix != ".npz" or not args.out.absolute().parent.is_dir():
        raise ConfigError(f"--out is {str(args.out)!r}", "an .npz file in an existing folder")
    rng = np.random.default_rng([args.seed, 4])
    levels = [LEVELS[k % len(LEVELS)] for k in range(args.count)]
    started = time.monotonic()
    pairs: dict[int, ViewPair] = {}

    def draw(scene: Callable[[], Scene], turns: Sequence[int]) -> None:
        """All pairs of a room, which is kept in memory for so long."""
        sampler = PairSampler(Renderer(scene()))
        for k in turns:
            pairs[k] = sampler.evaluation_pair(levels[k], rng)
            _show_progress(len(pairs), args.count, "pairs", started)

    for room, scene in enumerate(scenes.values()):
        turns = [k for k in range(args.count) if k // len(LEVELS) % len(scenes) == room]
        if turns:
            draw(scene, turns)
    write_arrays(args.out, evaluation_arrays([pairs[k] for k in range(args.count)], levels))
    return {args.out: len(pairs)}


def _show_progress(done: int, total: int, unit: str, started: float) -> None:
    left_s = (time.monotonic() - started) / done * (total - done)
    end = "\n" if done == total else ""
    print(f"\r{done} of {total} {unit}, {left_s:.0f} s left ", end=end, file=sys.stderr, flush=True)
