"""What ``dfvs-export depth`` does, and ``check`` with a depth bundle."""

from __future__ import annotations

import argparse
import json
from collections.abc import Mapping

import numpy as np

from dfvs_core.errors import ConfigError, ModelError
from dfvs_export.bundles import check_free, described, write_bundle
from dfvs_export.calibration import ImagePair, read_frames
from dfvs_export.check import drawn_pairs, operators
from dfvs_export.depth import MODELS, OWN, DepthModel, DepthWeights, Spreads
from dfvs_export.precision import in_precision
from dfvs_export.progress import say
from dfvs_export.running import BundleRunner
from dfvs_models.bundle import Bundle
from dfvs_models.depth import DepthNetwork
from dfvs_models.depth_evaluation import MeasuredDepth, mean_score, measure_depth
from dfvs_models.onnx_session import Execution

PARITY_LIMIT = 1e-3
"""Greatest difference in fp32 between torch and ONNX Runtime, over the range of the output."""
_CALIBRATION_SEED, _PARITY_SEED = 900_003, 900_004
_PARITY_PAIRS = 2


def run_depth(arguments: argparse.Namespace, size: tuple[int, int] | None) -> int:
    """Make a bundle of a depth network; 1 where ONNX Runtime does not give what torch gives.

    Raises
    ------
    ConfigError, ModelError
        If a package is missing, or weights, size, frames or folder cannot be used.
    """
    check_free(arguments.out)
    if arguments.calibration and arguments.precision != "int8":
        raise ConfigError(f"--calibration with {arguments.precision}", "it with --precision int8")
    if arguments.calibration_pairs < 1:
        raise ConfigError(f"{arguments.calibration_pairs} pairs to calibrate on", "1 or more")
    spreads = Spreads(arguments.spread, arguments.scale_spread)
    model = _model(arguments)
    say(f"tracing {arguments.model}")
    bundle = model.bundle(size, spreads)
    found = parity(model, bundle, _PARITY_PAIRS)
    say(f"greatest difference from torch: {found:.1e} of the range")
    if not found <= PARITY_LIMIT:
        print(f"not written: ONNX Runtime differs from torch by {found:.1e} of the range")
        return 1
    if arguments.precision == "int8":
        say("converting to int8")
        bundle = in_precision(bundle, "int8", _frames(arguments, bundle))
        say(f"greatest difference from torch: {parity(model, bundle, _PARITY_PAIRS):.1e}")
    network = DepthNetwork(bundle, Execution())  # as the service loads it: shapes, numbers
    measured = {path.name: measure_depth(network, path) for path in arguments.pairs}
    card = model.card(bundle.manifest, measured)
    write_bundle(arguments.out, described(bundle, card, _figures(measured)))
    if arguments.model != OWN and arguments.checkpoint is None and arguments.folder is None:
        print("warning: these weights are random; name --checkpoint or --from to use the network")
    print(f"wrote {arguments.out}")
    return 0


def parity(model: DepthModel, bundle: Bundle, count: int) -> float:
    """Greatest difference of a bundle from torch on drawn images, over the range of the output.

    Raises
    ------
    ModelError
        If either gives values that are not finite.
    """
    runner, picture = BundleRunner(bundle), bundle.manifest.input
    pairs = drawn_pairs((picture.width, picture.height), count, _PARITY_SEED)
    found = [model.differences(runner, image) for pair in pairs for image in pair]
    greatest = float(np.concatenate(found).max())
    if not np.isfinite(greatest):
        raise ModelError("torch or ONNX Runtime gives values that are not finite", "finite depth")
    return greatest


def check_depth(arguments: argparse.Namespace, bundle: Bundle) -> int:
    """Check a depth bundle; 1 where torch and ONNX Runtime differ.

    Raises
    ------
    ConfigError, ModelError
        If the bundle, or what it is to be compared with, cannot be used.
    """
    if arguments.pairs or arguments.reference:
        raise ConfigError("--pairs or --reference with a depth bundle", "a bundle of flow")
    manifest = bundle.manifest
    report: dict[str, object] = {
        "bundle": manifest.name,
        "precision": manifest.precision,
        "files": "all as announced",
        "operators": dict(operators(bundle.contents)),
    }
    DepthNetwork(bundle, Execution())  # as the service loads it: shapes, numbers
    holds = True
    if arguments.model in MODELS:
        say(f"comparing with torch on {arguments.count} drawn pairs")
        found = parity(_model(arguments), bundle, arguments.count)
        report["greatest_difference"] = found
        holds = found <= PARITY_LIMIT or manifest.precision != "fp32"
    else:
        report["torch"] = f"not compared: name the network (--model {'|'.join(MODELS)})"
    print(json.dumps(report, indent=None if arguments.json else 2))
    return 0 if holds else 1


def _figures(measured: Mapping[str, MeasuredDepth]) -> dict[str, float]:
    """What the manifest says of accuracy: means over the files."""
    if not measured:
        return {}
    scores = mean_score([result.score for result in measured.values()])
    figures = {"aligned_abs_rel": scores.aligned.abs_rel, "scale_log": scores.scale_log}
    if scores.metric is not None:
        figures["metric_abs_rel"] = scores.metric.abs_rel
    return figures


def _model(arguments: argparse.Namespace) -> DepthModel:
    weights = DepthWeights(arguments.checkpoint, arguments.folder, arguments.sha256)
    return DepthModel.load(arguments.model, weights)


def _frames(arguments: argparse.Namespace, bundle: Bundle) -> list[ImagePair]:
    """Images to calibrate on: given ones, or else drawn patches."""
    size = bundle.manifest.input.width, bundle.manifest.input.height
    if arguments.calibration:
        return read_frames(arguments.calibration, size, arguments.calibration_pairs)
    return drawn_pairs(size, arguments.calibration_pairs, _CALIBRATION_SEED)
