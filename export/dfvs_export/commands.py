"""What ``dfvs-export flow`` and ``check`` do."""

from __future__ import annotations

import argparse
import json
from pathlib import Path

import numpy as np

from dfvs_core.errors import ConfigError, ModelError
from dfvs_core.matching.matcher import Matcher
from dfvs_core.messages.manifest import Manifest
from dfvs_export.bundles import check_free, described, write_bundle
from dfvs_export.calibration import ImagePair, read_frames
from dfvs_export.check import (
    MOST_ERROR_RATIO,
    accuracy,
    accuracy_figures,
    drawn_pairs,
    error_ratios,
    operators,
    parity,
)
from dfvs_export.depth_command import check_depth
from dfvs_export.foreign import PREFIX, ForeignWeights, PublishedFlow
from dfvs_export.network import MatchingNetwork
from dfvs_export.own import NAME, OwnFlow
from dfvs_export.pose import check_pose
from dfvs_export.precision import in_precision
from dfvs_export.progress import say
from dfvs_export.running import BundleRunner
from dfvs_models.bundle import read_bundle
from dfvs_models.catalog import bundle_folder, network_matcher
from dfvs_models.evaluation_file import read_flow_pairs
from dfvs_models.onnx_session import Execution

_OWN_SIZE, _PAIR_SIZE = (640, 480), (320, 240)
_CALIBRATION_SEED = 900_001
_PARITY_SEED = 900_002


def run_flow(arguments: argparse.Namespace, size: tuple[int, int] | None) -> int:
    """Make a bundle of a network for images of ``size`` (width, height) px.

    Raises
    ------
    ConfigError, ModelError
        If the model is unknown, or its weights, the frames or the folder cannot be used.
    """
    check_free(arguments.out)
    pairs = read_flow_pairs(arguments.pairs) if arguments.pairs else None
    if arguments.calibration and arguments.precision != "int8":
        raise ConfigError(f"--calibration with {arguments.precision}", "it with --precision int8")
    size = size or (_OWN_SIZE if arguments.model == NAME else _PAIR_SIZE)
    network = _network(arguments)
    say(f"tracing {arguments.model} at {size[0]}x{size[1]}")
    bundle = network.bundle(size)
    if arguments.precision != "fp32":
        say(f"converting to {arguments.precision}")
        frames = _frames(arguments, size) if arguments.precision == "int8" else []
        bundle = in_precision(bundle, arguments.precision, frames)
    scores = {}
    if pairs is not None:
        say(f"measuring accuracy on {arguments.pairs}")
        scores = accuracy(network_matcher(bundle, Execution()), pairs)
    card = network.card(bundle.manifest, scores, Path(arguments.pairs or "").name)
    write_bundle(arguments.out, described(bundle, card, accuracy_figures(scores)))
    if arguments.model != NAME and arguments.weights is None:
        print("warning: these weights are random; name --weights to use the network")
    print(f"wrote {arguments.out}")
    return 0


def _network(arguments: argparse.Namespace) -> MatchingNetwork:
    """Load the network that ``--model`` and the weights name.

    Raises
    ------
    ConfigError, ModelError
        If there is no such network, or its weights cannot be used.
    """
    checkpoint, weights, digest = arguments.checkpoint, arguments.weights, arguments.sha256
    if arguments.model == NAME:
        if weights is not None or digest is not None:
            raise ConfigError(f"--weights or --sha256 for {NAME}", "--checkpoint FILE.pt")
        return OwnFlow.load(checkpoint)
    if not arguments.model.startswith(PREFIX):
        raise ConfigError(f"model {arguments.model!r}", f"{NAME!r} or '{PREFIX}NAME'")
    if checkpoint is not None and weights is not None:
        raise ConfigError("--checkpoint and --weights together", "one of them")
    if checkpoint is not None and not checkpoint.is_file():
        raise ConfigError(f"no checkpoint at {checkpoint}", "a file")
    source = weights if checkpoint is None else str(checkpoint)
    name = arguments.model.removeprefix(PREFIX)
    return PublishedFlow.load(name, ForeignWeights(source, digest))


def _frames(arguments: argparse.Namespace, size: tuple[int, int]) -> list[ImagePair]:
    """Pictures to calibrate on: given ones, or else drawn rooms."""
    count = arguments.calibration_pairs
    if count < 1:
        raise ConfigError(f"{count} pairs to calibrate on", "1 or more")
    if arguments.calibration:
        return read_frames(arguments.calibration, size, count)
    return drawn_pairs(size, count, _CALIBRATION_SEED)


def run_check(arguments: argparse.Namespace) -> int:
    """Check a bundle; 1 where torch and ONNX Runtime differ, or too much accuracy was lost.

    Raises
    ------
    ConfigError, ModelError
        If the bundle, or what it is to be compared with, cannot be used.
    """
    bundle = read_bundle(bundle_folder(arguments.bundle))
    if bundle.manifest.kind == "mono":
        return check_depth(arguments, bundle)
    if bundle.manifest.kind == "pose":
        return check_pose(arguments, bundle)
    if arguments.folder is not None:
        raise ConfigError("--from with a bundle of flow", "a depth bundle")
    report: dict[str, object] = {
        "bundle": bundle.manifest.name,
        "precision": bundle.manifest.precision,
        "files": "all as announced",
        "operators": dict(operators(bundle.contents)),
    }
    matcher = network_matcher(bundle, Execution())  # as the service loads it: shapes, numbers
    if arguments.count < 1:
        raise ConfigError(f"--count is {arguments.count}", "1 or more")
    if arguments.reference and not arguments.pairs:
        raise ConfigError("--reference without --pairs", "--pairs PAIRS.npz to compare accuracy on")
    holds = True
    if _knows_weights(arguments, bundle.manifest):
        holds &= _check_parity(arguments, BundleRunner(bundle), report)
    else:
        report["torch"] = "not compared: weights that were not named (--checkpoint, --model)"
    if arguments.pairs:
        holds &= _check_accuracy(arguments, matcher, report)
    print(json.dumps(report, indent=None if arguments.json else 2))
    return 0 if holds else 1


def _knows_weights(arguments: argparse.Namespace, manifest: Manifest) -> bool:
    """Whether the network that a bundle was made of is named, or is the shipped one."""
    is_named = arguments.checkpoint is not None or arguments.model != NAME
    return is_named or manifest.origin == OwnFlow.load(None).origin


def _check_parity(
    arguments: argparse.Namespace, runner: BundleRunner, report: dict[str, object]
) -> bool:
    """Compare with torch; whether they agree is only asked of fp32."""
    manifest = runner.bundle.manifest
    say(f"comparing with torch on {arguments.count} drawn pairs")
    size = (manifest.input.width, manifest.input.height)
    found = parity(_network(arguments), runner, drawn_pairs(size, arguments.count, _PARITY_SEED))
    report |= {
        "greatest_difference_px": found.greatest_px,
        "mean_difference_px": found.mean_px,
    }
    if not np.isfinite(found.greatest_px):
        raise ModelError("torch or ONNX Runtime gives values that are not finite", "finite flow")
    return found.holds or manifest.precision != "fp32"


def _check_accuracy(
    arguments: argparse.Namespace, matcher: Matcher, report: dict[str, object]
) -> bool:
    """Measure accuracy and, where a reference is given, how much of it was lost."""
    say(f"measuring accuracy on {arguments.pairs}")
    pairs = read_flow_pairs(arguments.pairs)
    scores = accuracy(matcher, pairs)
    report["accuracy"] = accuracy_figures(scores)
    if not arguments.reference:
        return True
    say(f"measuring accuracy of {arguments.reference}")
    reference = network_matcher(read_bundle(bundle_folder(arguments.reference)), Execution())
    ratios = error_ratios(scores, accuracy(reference, pairs))
    report["error_over_reference"] = ratios
    return max(ratios.values()) <= MOST_ERROR_RATIO
