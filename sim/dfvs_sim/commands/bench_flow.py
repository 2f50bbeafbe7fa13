"""``dfvs-bench flow``: how precise a matcher is on pairs with exact flow, and how honest."""

from __future__ import annotations

import argparse
import json
import time
import zipfile
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any

import cv2
import numpy as np

from dfvs_core.arrays import BoolArray, Float32Array, ImageArray
from dfvs_core.errors import ImageError, ModelError
from dfvs_core.matching.classical import ClassicalMatcher
from dfvs_core.matching.evaluation import LEVELS, LevelScore, PairScore, score_pair, summarise
from dfvs_core.matching.matcher import Matcher

_EPILOG = """example:
  dfvs-bench flow pairs.npz --bundle classical --json flow.json

A pairs file holds IA, IB (N,H,W,3) uint8 RGB, flow (N,H,W,2) px from A to B on A's grid,
vis (N,H,W) bool: seen in both, and level (N,) 0 small, 1 medium, 2 large.
"""
_MATCHERS = {"classical": ClassicalMatcher}
_WARM_UP = 2
_COLUMNS = "level    pairs   EPE px  <3 px   half px  correlation  sure  wrong  failed but sure"


@dataclass(frozen=True, slots=True)
class FlowPairs:
    """Picture pairs with exact flow, as in a pairs file; see ``dfvs-bench flow --help``."""

    current: ImageArray
    other: ImageArray
    flow: Float32Array
    visible: BoolArray
    level: np.ndarray[Any, np.dtype[np.int64]]


@dataclass(frozen=True, slots=True)
class Measured:
    """Scores by level, and the time of a match in ms without and with a guess."""

    levels: dict[str, LevelScore]
    cold_ms: list[float]
    warm_ms: list[float]


def add_parser(subparsers: Any) -> None:
    """Add ``flow`` to the subcommands of ``dfvs-bench``."""
    parser = subparsers.add_parser(
        "flow",
        help="precision and honesty of dense correspondences",
        description="Match picture pairs whose flow is known; print end-point error, share "
        "under 3 px, error of the more confident half, and time a pair.",
        epilog=_EPILOG,
        formatter_class=argparse.RawDescriptionHelpFormatter,
    )
    add = parser.add_argument
    add("pairs", type=Path, nargs="+", metavar="PAIRS.npz")
    add("--bundle", default="classical", help="matcher to measure (default: classical)")
    add("--threads", type=int, default=2, help="threads for OpenCV (default: 2)")
    add("--json", type=Path, metavar="FILE", help="write the figures as JSON, too")
    parser.set_defaults(run=run)


def run(args: argparse.Namespace) -> int:
    """Measure, print, and write; exit code 0."""
    if args.bundle not in _MATCHERS:
        raise ModelError(f"no matcher {args.bundle!r} here", f"one of {', '.join(_MATCHERS)}")
    cv2.setNumThreads(args.threads)
    matcher = _MATCHERS[args.bundle]()
    measured = {path.stem: measure(matcher, load_pairs(path)) for path in args.pairs}
    for name, result in measured.items():
        _print_table(name, result)
    cold = [ms for result in measured.values() for ms in result.cold_ms]
    warm = [ms for result in measured.values() for ms in result.warm_ms]
    print(f"\nms a pair: {np.mean(cold):.1f} cold, {np.mean(warm):.1f} with a guess")
    if args.json is not None:
        report = {
            "bundle": args.bundle,
            "files": {
                name: {level: asdict(score) for level, score in result.levels.items()}
                for name, result in measured.items()
            },
            "ms_per_pair": float(np.mean(cold)),
            "ms_per_pair_with_guess": float(np.mean(warm)),
        }
        args.json.write_text(json.dumps(report, indent=2) + "\n", encoding="utf-8")
    return 0


def load_pairs(path: Path) -> FlowPairs:
    """Read a pairs file.

    Raises
    ------
    ImageError
        If it cannot be read, lacks an array, or its arrays do not fit each other.
    """
    try:
        with np.load(path, allow_pickle=False) as data:
            arrays = {name: data[name] for name in ("IA", "IB", "flow", "vis", "level")}
    except (OSError, ValueError, KeyError, zipfile.BadZipFile) as error:
        raise ImageError(
            f"pairs file {str(path)!r} cannot be read ({error})",
            "an .npz with IA, IB, flow, vis and level",
        ) from error
    count, height, width = arrays["IA"].shape[:3]
    expected = {
        "IA": (count, height, width, 3),
        "IB": (count, height, width, 3),
        "flow": (count, height, width, 2),
        "vis": (count, height, width),
        "level": (count,),
    }
    for name, shape in expected.items():
        if arrays[name].shape != shape:
            raise ImageError(
                f"{name} in {str(path)!r} has the shape {arrays[name].shape}", str(shape)
            )
    if count == 0 or not np.isin(arrays["level"], range(len(LEVELS))).all():
        raise ImageError(f"{str(path)!r} holds {count} pairs or an unknown level", "levels 0, 1, 2")
    return FlowPairs(
        arrays["IA"],
        arrays["IB"],
        arrays["flow"].astype(np.float32),
        arrays["vis"].astype(np.bool_),
        arrays["level"].astype(np.int64),
    )


def measure(matcher: Matcher, pairs: FlowPairs) -> Measured:
    """Match every pair without a guess, then again with the flow found as the guess."""
    scores: dict[str, list[PairScore]] = {}
    cold_ms: list[float] = []
    warm_ms: list[float] = []
    for k in range(-min(_WARM_UP, len(pairs.level)), len(pairs.level)):
        started = time.perf_counter()
        current = matcher.prepare(pairs.current[k])
        other = matcher.prepare(pairs.other[k])
        field = matcher.match(current, other)
        matched = time.perf_counter()
        matcher.match(current, other, field)
        tracked = time.perf_counter()
        if k < 0:
            continue
        cold_ms.append(1e3 * (matched - started))
        warm_ms.append(1e3 * (tracked - matched))
        level = LEVELS[int(pairs.level[k])]
        scores.setdefault(level, []).append(score_pair(field, pairs.flow[k], pairs.visible[k]))
    levels = {level: summarise(scores[level]) for level in LEVELS if level in scores}
    return Measured(levels, cold_ms, warm_ms)


def _print_table(name: str, result: Measured) -> None:
    print(f"\n{name}\n{_COLUMNS}")
    for level, s in result.levels.items():
        print(
            f"{level:<8} {s.pairs:>5}  {s.epe_px:>7.2f}  {s.under_3px:>5.1%}  "
            f"{s.sure_half_epe_px:>7.2f}  {s.confidence_correlation:>11.2f}  "
            f"{s.sure_share:>4.0%}  {s.sure_wrong:>5.1%}  {s.failed_but_sure:>5}"
        )
