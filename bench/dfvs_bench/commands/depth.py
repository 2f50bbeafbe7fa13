"""``dfvs-bench depth``: how good a depth network is, and whether its uncertainty is honest."""

import argparse
from dataclasses import asdict
from typing import Any

from dfvs_bench.options import add_pairs_options, check_pairs_options
from dfvs_models import DEFAULT_DEPTH
from dfvs_models.catalog import load_depth_network
from dfvs_models.depth_evaluation import measure_depth
from dfvs_models.evaluation_file import labelled
from dfvs_sim.options import write_json

_EPILOG = """examples:
  dfvs-bench depth pairs.npz --json depth.json
  dfvs-bench depth pairs.npz --depth-bundle dfvs-depth ./my-depth

A pairs file holds IA (N,H,W,3) uint8 RGB, its depth (N,H,W) m (0: unknown), seen by a camera of
75 degrees (dfvs-rooms pairs makes such files). Aligned: with the scale that fits an image best.

The JSON is [{bundle, unit, files: {NAME: {images, median_ms, score: {metric: {abs_rel, rmse_m,
close}, aligned: {...}, scale_log, within_spread}}}}]; metric and scale_log are null unless depth is
metric.
"""


def add_parser(subparsers: Any) -> None:
    """Add ``depth`` to the subcommands of ``dfvs-bench``."""
    parser = subparsers.add_parser(
        "depth",
        help="accuracy and honesty of a depth network",
        description="Estimate the depth of images whose depth is known; print relative error, "
        "RMSE and the share within 25 %, metric and aligned, and the time of an image.",
        epilog=_EPILOG,
    )
    add_pairs_options(parser, "the network")
    parser.add_argument("--depth-bundle", nargs="+", default=[DEFAULT_DEPTH], metavar="NAME")
    parser.set_defaults(run=run)


def run(args: argparse.Namespace) -> int:
    """Measure, print, and write; exit code 0."""
    check_pairs_options(args)
    reports = []
    for name in dict.fromkeys(args.depth_bundle):
        network = load_depth_network(name, args.threads)
        paths = labelled(args.pairs)
        files = {label: asdict(measure_depth(network, path)) for label, path in paths.items()}
        reports.append({"bundle": name, "unit": network.unit, "files": files})
        _print(reports[-1])
    if args.json is not None:
        write_json(args.json, reports)
    return 0


def _print(report: dict[str, Any]) -> None:
    print(f"\n{report['bundle']}, {report['unit']}\n          abs-rel   RMSE m  within 25 %")
    for name, measured in report["files"].items():
        score = measured["score"]
        print(f"{name}: {measured['images']} images, {measured['median_ms']:.1f} ms each")
        for kind in ("metric", "aligned"):
            if (error := score[kind]) is not None:
                print(
                    f"{kind:<8}  {error['abs_rel']:>7.3f}  {error['rmse_m']:>7.3f}  "
                    f"{error['close']:>10.1%}"
                )
        if score["scale_log"] is not None:
            print(f"ln scale off by {score['scale_log']:.3f} (rms)")
        print(f"{score['within_spread']:.0%} of pixels within the stated uncertainty")
