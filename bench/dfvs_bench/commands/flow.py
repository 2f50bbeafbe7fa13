"""``dfvs-bench flow``: how precise correspondences are, and whether their confidence is honest."""

import argparse
import sys
import time
from dataclasses import asdict, dataclass, field
from typing import Any

import numpy as np

from dfvs_bench.options import add_pairs_options, check_pairs_options
from dfvs_core.matching.matcher import Matcher, track_or_match
from dfvs_models import DEFAULT_MATCHER
from dfvs_models.catalog import load_matcher
from dfvs_models.evaluation import FlowScores, LevelScore
from dfvs_models.evaluation_file import FlowPairs, labelled, read_flow_pairs
from dfvs_sim.options import write_json

_EPILOG = """examples:
  dfvs-bench flow pairs.npz --json flow.json
  dfvs-bench flow room_a.npz room_b.npz --bundle classical dfvs-flow ./my-bundle

A pairs file holds IA, IB (N,H,W,3) uint8 RGB, flow (N,H,W,2) px from A to B on A's grid,
vis (N,H,W) bool: seen in both, and level (N,) 0 small, 1 medium, 2 large (dfvs-rooms pairs
makes such files). A bundle whose images have another size gets them resized, and its flow
is resized back.

The JSON is {bundle, files: {NAME: {small|medium|large: {epe_px, under_3px, pairs, ...}}},
ms_per_pair, ...}, or a list of these where several bundles are measured.
"""
_WARM_UP = 2
_GUESS_EVERY = 3
_COLUMNS = "level    pairs   EPE px  <3 px   half px  correlation  sure  wrong  failed but sure"


@dataclass(slots=True)
class Measured:
    """Scores of a matcher by file and level, and the time of a match in ms."""

    files: dict[str, dict[str, LevelScore]] = field(default_factory=dict)
    """Scores by name of the file and level."""
    cold_ms: list[float] = field(default_factory=list)
    warm_ms: list[float] = field(default_factory=list)
    """Matching again with the flow found as the guess; cold is preparing and matching two."""

    def report(self, bundle: str) -> dict[str, Any]:
        """Everything as JSON holds it."""
        return {
            "bundle": bundle,
            "files": {
                name: {level: asdict(score) for level, score in levels.items()}
                for name, levels in self.files.items()
            },
            "ms_per_pair": float(np.mean(self.cold_ms)),
            "ms_per_pair_with_guess": float(np.mean(self.warm_ms)),
        }


def add_parser(subparsers: Any) -> None:
    """Add ``flow`` to the subcommands of ``dfvs-bench``."""
    parser = subparsers.add_parser(
        "flow",
        help="precision and honesty of dense correspondences",
        description="Match image pairs whose flow is known; print end-point error, share "
        "under 3 px, error of the more confident half, and time a pair.",
        epilog=_EPILOG,
    )
    add_pairs_options(parser, "the network and OpenCV")
    parser.add_argument(
        "--bundle",
        nargs="+",
        action="extend",
        metavar="NAME",
        help="'classical', a bundle's folder or name, or 'hybrid:' and a bundle of flow; "
        f"several are measured one after the other (default: {DEFAULT_MATCHER})",
    )
    parser.set_defaults(run=run)


def run(args: argparse.Namespace) -> int:
    """Measure, print, and write; exit code 0."""
    check_pairs_options(args)
    bundles = list(dict.fromkeys(args.bundle or [DEFAULT_MATCHER]))
    matchers = {name: load_matcher(name, args.threads) for name in bundles}
    measured = {name: Measured() for name in bundles}
    for label, path in labelled(args.pairs).items():
        pairs = read_flow_pairs(path)
        for name, matcher in matchers.items():
            _progress(f"{label}: {name} ")
            measure(matcher, pairs, label, measured[name])
    _progress("")
    for name, result in measured.items():
        _print_tables(name, result)
    if args.json is not None:
        reports = [result.report(name) for name, result in measured.items()]
        write_json(args.json, reports[0] if len(reports) == 1 else reports)
    return 0


def measure(matcher: Matcher, pairs: FlowPairs, label: str, result: Measured) -> None:
    """Match every pair, every third also with a guess, and add what came of it to a result."""
    scores = FlowScores()
    for k in range(-min(_WARM_UP, len(pairs.level)), len(pairs.level)):
        started = time.perf_counter()
        current = matcher.encode(pairs.current[k])
        other = matcher.encode(pairs.other[k])
        flow = matcher.match(current, other)
        matched = time.perf_counter()
        if k < 0:
            continue
        result.cold_ms.append(1e3 * (matched - started))
        if k % _GUESS_EVERY == 0:
            matched = time.perf_counter()
            track_or_match(matcher, current, other, flow)
            result.warm_ms.append(1e3 * (time.perf_counter() - matched))
        scores.add(flow, pairs.flow[k], pairs.visible[k], int(pairs.level[k]))
    result.files[label] = scores.means()


def _progress(text: str) -> None:
    print(f"\r{text:<60}", end="" if text else "\r", file=sys.stderr, flush=True)


def _print_tables(bundle: str, result: Measured) -> None:
    for name, levels in result.files.items():
        print(f"\n{bundle} on {name}\n{_COLUMNS}")
        for level, s in levels.items():
            print(
                f"{level:<8} {s.pairs:>5}  {s.epe_px:>7.2f}  {s.under_3px:>5.1%}  "
                f"{s.confident_half_epe_px:>7.2f}  {s.confidence_correlation:>11.2f}  "
                f"{s.confident_ratio:>4.0%}  {s.confident_failed:>5.1%}  {s.confident_failures:>5}"
            )
    cold, warm = np.mean(result.cold_ms), np.mean(result.warm_ms)
    print(f"{bundle}: {cold:.1f} ms a pair, {warm:.1f} with a guess")
