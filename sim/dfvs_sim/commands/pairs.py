"""``dfvs-sim pairs``: pairs of views with exact flow, to measure by and to train on."""

from __future__ import annotations

import argparse
import functools
import json
import math
import re
import sys
import time
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Any

import numpy as np

from dfvs_core.camera import CameraModel
from dfvs_core.errors import ConfigError
from dfvs_core.matching.evaluation import LEVELS
from dfvs_core.pair_files import PAIRS_PER_SHARD, shard_name
from dfvs_sim.pairs.drawing import EVALUATION_CAMERA, PairArtist
from dfvs_sim.pairs.files import evaluation_arrays, shard_arrays, write_arrays
from dfvs_sim.render.renderer import Renderer
from dfvs_sim.scene.bake import light_room
from dfvs_sim.scene.glb import load_glb
from dfvs_sim.scene.interior import KINDS, drawn_interior
from dfvs_sim.scene.kinds import BENCHMARK_SEEDS, ROOM_KINDS, room_of_kind
from dfvs_sim.scene.room import Room

_ROOMS_PER_SHARD = 4
_ROOMS_KEPT = 40
_MAX_PAIRS = 1_000_000
_EPILOG = """examples:
  dfvs-sim pairs --format eval --scene room.glb --count 45 --seed 1 --out room.npz
  dfvs-sim pairs --rooms 1000-1031 --size 192x144 --count 3200 --seed 0 --out runs/room_pairs
  dfvs-sim pairs --rooms 2000-2063 --kinds all --count 3200 --seed 500 --out runs/place_pairs
"""


def add_parser(subparsers: Any) -> None:
    """Add ``pairs`` to the subcommands of ``dfvs-sim``."""
    parser = subparsers.add_parser(
        "pairs",
        help="pairs of views with exact flow",
        description="Render pairs of views of rooms, with exact flow and what both see: a file of "
        "small, medium and large motions in turn for dfvs-bench, or shards of 64 pairs of both "
        "directions for training. The seed and the rooms decide every bit of them.",
        epilog=_EPILOG,
        formatter_class=argparse.RawDescriptionHelpFormatter,
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
    add("--format", choices=("shards", "eval"), default="shards", help="default: shards")
    add("--count", type=int, required=True, metavar="N", help="pairs (shards: rounded up to 64)")
    add("--seed", type=int, required=True, help="decides the views; of the first shard")
    add("--size", default="192x144", metavar="WxH", help="picture size of shards (192x144)")
    add("--out", type=Path, required=True, help="folder of shards, or evaluation file (.npz)")
    add("--json", action="store_true", help="print what was written as JSON")
    parser.set_defaults(run=run)


def run(args: argparse.Namespace) -> int:
    """Draw and write the pairs; exit code 0.

    Raises
    ------
    DfvsError
        If an option or a scene cannot be used.
    """
    if not 1 <= args.count <= _MAX_PAIRS:
        raise ConfigError(f"--count is {args.count}", f"1 to {_MAX_PAIRS}")
    if args.seed < 0:
        raise ConfigError(f"--seed is {args.seed}", "0 or more")
    artists = _artists(args)
    written = (
        _write_shards(args, artists) if args.format == "shards" else _write_file(args, artists)
    )
    report = {"pairs": sum(written.values()), "files": [str(path) for path in written]}
    if args.json:
        print(json.dumps(report, indent=2))
    else:
        print(f"wrote {report['pairs']} pairs in {len(written)} files to {args.out}")
    return 0


_Artists = Sequence[Callable[[], PairArtist]]
"""One maker of an artist per room; a room is made when it is first asked for."""


def _artists(args: argparse.Namespace) -> _Artists:
    kinds = _kinds(args.kinds)

    @functools.lru_cache(maxsize=_ROOMS_KEPT)
    def in_interior(seed: int) -> PairArtist:
        return PairArtist(Renderer(light_room(_room(seed, kinds), seed)))

    @functools.lru_cache(maxsize=_ROOMS_KEPT)
    def in_scene(path: Path) -> PairArtist:
        return PairArtist(Renderer(load_glb(path)))

    if args.scene is not None:
        if args.kinds is not None:
            raise ConfigError("--kinds was given with --scene", "--kinds with --rooms")
        return [functools.partial(in_scene, path) for path in args.scene]
    return [functools.partial(in_interior, seed) for seed in _seeds(args.rooms)]


def _kinds(words: str | None) -> tuple[str, ...]:
    """Kinds of rooms of ``A,B``; none where nothing is said.

    Raises
    ------
    ConfigError
        If there is no such kind.
    """
    if words is None:
        return ()
    kinds = ROOM_KINDS if words == "all" else tuple(words.split(","))
    for kind in kinds:
        if kind not in ROOM_KINDS:
            raise ConfigError(f"no kind of room {kind!r}", f"'all', or of {', '.join(ROOM_KINDS)}")
    return kinds


def _room(seed: int, kinds: tuple[str, ...]) -> Room:
    """Room of one of the kinds; the seed decides on both."""
    if not kinds:
        return drawn_interior(seed)
    drawn = int(np.random.default_rng([seed, 6]).integers(len(kinds)))
    return room_of_kind(kinds[drawn], seed)


def _seeds(words: str) -> range:
    """Seeds A to B of ``A-B``, or the one of ``A``.

    Raises
    ------
    ConfigError
        If it is neither, or takes in a seed that is kept for the benchmark.
    """
    match = re.fullmatch(r"(\d{1,9})(?:-(\d{1,9}))?", words)
    first, last = (int(match[1]), int(match[2] or match[1])) if match else (1, 0)
    if last < first:
        raise ConfigError(f"--rooms is {words!r}", "seeds such as 1000-1031")
    if first <= BENCHMARK_SEEDS[-1] and last >= BENCHMARK_SEEDS[0]:
        raise ConfigError(
            f"--rooms is {words!r}",
            f"other seeds than {BENCHMARK_SEEDS[0]} to {BENCHMARK_SEEDS[-1]}, the benchmark's own",
        )
    return range(first, last + 1)


def _write_shards(args: argparse.Namespace, artists: _Artists) -> dict[Path, int]:
    """Write shards of the seeds --seed, --seed + 1, ...; each from four rooms that follow."""
    size = _size(args.size)
    try:
        args.out.mkdir(parents=True, exist_ok=True)
    except OSError as error:
        raise ConfigError(f"{args.out} cannot be made ({error})", "a folder") from error
    written = {}
    shards = -(-args.count // PAIRS_PER_SHARD)
    started = time.monotonic()
    for seed in range(args.seed, args.seed + shards):
        rng = np.random.default_rng([seed, 3])
        rooms = [artists[(seed * _ROOMS_PER_SHARD + k) % len(artists)] for k in range(4)]
        pairs = [
            rooms[k % _ROOMS_PER_SHARD]().training_pair(size, rng) for k in range(PAIRS_PER_SHARD)
        ]
        path = args.out / shard_name(size, seed)
        write_arrays(path, shard_arrays(pairs), compressed=False)
        written[path] = len(pairs)
        _show_progress(sum(written.values()), shards * PAIRS_PER_SHARD, started)
    return written


def _size(words: str) -> tuple[int, int]:
    """Width and height, px, of ``WxH``.

    Raises
    ------
    DfvsError
        If it is none, or too small for a camera.
    """
    match = re.fullmatch(r"(\d{2,4})x(\d{2,4})", words)
    if match is None:
        raise ConfigError(f"--size is {words!r}", "WIDTHxHEIGHT such as 192x144")
    return CameraModel.from_horizontal_fov(int(match[1]), int(match[2]), 0.5 * math.pi).size


def _write_file(args: argparse.Namespace, artists: _Artists) -> dict[Path, int]:
    """Write an evaluation file; the rooms and the levels take turns."""
    if args.out.suffix != ".npz" or not args.out.absolute().parent.is_dir():
        raise ConfigError(f"--out is {str(args.out)!r}", "an .npz file in an existing folder")
    if args.size not in ("192x144", "{}x{}".format(*EVALUATION_CAMERA.size)):
        raise ConfigError(f"--size is {args.size!r} with --format eval", "320x240, or no --size")
    rng = np.random.default_rng([args.seed, 4])
    levels = [LEVELS[k % len(LEVELS)] for k in range(args.count)]
    started = time.monotonic()
    pairs = []
    for k, level in enumerate(levels):
        room = artists[k // len(LEVELS) % len(artists)]
        pairs.append(room().evaluation_pair(level, rng))
        _show_progress(k + 1, args.count, started)
    write_arrays(args.out, evaluation_arrays(pairs, levels), compressed=True)
    return {args.out: len(pairs)}


def _show_progress(done: int, total: int, started: float) -> None:
    left_s = (time.monotonic() - started) / done * (total - done)
    end = "\n" if done == total else ""
    print(f"\r{done} of {total} pairs, {left_s:.0f} s left ", end=end, file=sys.stderr, flush=True)
