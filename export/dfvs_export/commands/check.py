"""What ``dfvs-export check`` does."""

import argparse
import json
from collections import Counter
from collections.abc import Mapping

import onnx
from google.protobuf.message import DecodeError

from dfvs_common.progress import log
from dfvs_core.errors import ConfigError, ModelError
from dfvs_core.matching.matcher import Matcher
from dfvs_export.bundles.depth import MODELS
from dfvs_export.bundles.own_flow import NAME, OwnFlow
from dfvs_export.bundles.pose import PoseModel
from dfvs_export.checks.accuracy import MOST_ERROR_RATIO, accuracy, accuracy_figures, error_ratios
from dfvs_export.checks.parity import TorchNetwork
from dfvs_export.commands.comparison import compare_with_torch
from dfvs_export.commands.depth import named_depth_model
from dfvs_export.commands.flow import named_matching_network
from dfvs_export.weights.flow import load_weights
from dfvs_models.bundle import Bundle, read_bundle
from dfvs_models.catalog import bundle_folder, network_matcher
from dfvs_models.depth import DepthNetwork
from dfvs_models.evaluation_file import read_flow_pairs
from dfvs_models.onnx_session import Execution
from dfvs_models.pose import PoseNetwork

_NOT_FLOW = {"mono": (DepthNetwork, "a depth bundle"), "pose": (PoseNetwork, "a pose bundle")}
"""Kinds of bundles that give no flow: what loads them, and their name."""


def run(arguments: argparse.Namespace) -> int:
    """Check a bundle; 1 where torch and ONNX Runtime differ, or too much accuracy was lost."""
    bundle = read_bundle(bundle_folder(arguments.bundle))
    manifest = bundle.manifest
    _check_options(arguments, manifest.kind)
    report: dict[str, object] = {
        "bundle": manifest.name,
        "precision": manifest.precision,
        "files": "all as announced",
        "operators": dict(operators(bundle.contents)),
    }
    matcher = _load(bundle)
    if arguments.count < 1:
        raise ConfigError(f"--count is {arguments.count}", "1 or more")
    if arguments.reference and not arguments.pairs:
        raise ConfigError("--reference without --pairs", "--pairs PAIRS.npz to compare accuracy on")
    holds = _check_parity(arguments, bundle, report)
    if arguments.pairs and matcher is not None:
        holds &= _check_accuracy(arguments, matcher, report)
    print(json.dumps(report, indent=None if arguments.json else 2))
    return 0 if holds else 1


def operators(contents: Mapping[str, bytes]) -> Counter[str]:
    """Count the operators of all ONNX files.

    Raises
    ------
    ModelError
        If a file is not valid ONNX.
    """
    counts: Counter[str] = Counter()
    for name, data in contents.items():
        if not name.endswith(".onnx"):
            continue
        try:
            model = onnx.load_model_from_string(data)
            onnx.checker.check_model(model)
        except (DecodeError, onnx.checker.ValidationError) as error:
            raise ModelError(f"{name} is not valid ONNX: {error}") from error
        counts.update(node.op_type for node in model.graph.node)
    return counts


def _check_options(arguments: argparse.Namespace, kind: str) -> None:
    """Refuse options that are of another kind of bundle."""
    if kind in _NOT_FLOW and (arguments.pairs or arguments.reference):
        raise ConfigError(f"--pairs or --reference with {_NOT_FLOW[kind][1]}", "a bundle of flow")
    if kind not in _NOT_FLOW and arguments.folder is not None:
        raise ConfigError("--from with a bundle of flow", "a depth bundle")


def _load(bundle: Bundle) -> Matcher | None:
    """Load the bundle as its users do, which checks shapes and numbers; a matcher if it is one."""
    if bundle.manifest.kind not in _NOT_FLOW:
        return network_matcher(bundle, Execution())
    _NOT_FLOW[bundle.manifest.kind][0](bundle, Execution())
    return None


def _named_network(arguments: argparse.Namespace, bundle: Bundle) -> TorchNetwork | str:
    """The network that the bundle was made of, or which option would name it."""
    if bundle.manifest.kind == "mono":
        if arguments.model in MODELS:
            return named_depth_model(arguments)
        return f"name the network (--model {'|'.join(MODELS)})"
    if bundle.manifest.kind == "pose":
        if arguments.checkpoint is not None:
            return PoseModel.load(arguments.checkpoint)
        return "name the weights (--checkpoint)"
    is_named = arguments.checkpoint is not None or arguments.model != NAME
    if is_named or bundle.manifest.origin == OwnFlow(load_weights(None)).origin:
        return named_matching_network(arguments)
    return "weights that were not named (--checkpoint, --model)"


def _check_parity(arguments: argparse.Namespace, bundle: Bundle, report: dict[str, object]) -> bool:
    """Compare with torch; whether they agree is only asked of fp32."""
    network = _named_network(arguments, bundle)
    if isinstance(network, str):
        report["torch"] = f"not compared: {network}"
        return True
    log(f"comparing with torch on {arguments.count} drawn pairs")
    found = compare_with_torch(network, bundle, arguments.count)
    if bundle.manifest.kind in _NOT_FLOW:
        report["greatest_difference"] = found.greatest
    else:
        report |= {"greatest_difference_px": found.greatest, "mean_difference_px": found.mean}
    return found.holds or bundle.manifest.precision != "fp32"


def _check_accuracy(
    arguments: argparse.Namespace, matcher: Matcher, report: dict[str, object]
) -> bool:
    """Measure accuracy and, where a reference is given, how much of it was lost."""
    log(f"measuring accuracy on {arguments.pairs}")
    pairs = read_flow_pairs(arguments.pairs)
    scores = accuracy(matcher, pairs)
    report["accuracy"] = accuracy_figures(scores)
    if not arguments.reference:
        return True
    log(f"measuring accuracy of {arguments.reference}")
    reference = network_matcher(read_bundle(bundle_folder(arguments.reference)), Execution())
    ratios = error_ratios(scores, accuracy(reference, pairs))
    report["error_over_reference"] = ratios
    return max(ratios.values()) <= MOST_ERROR_RATIO
