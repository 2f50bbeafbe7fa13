"""What ``dfvs-export flow`` does."""

import argparse
from pathlib import Path

from dfvs_common.progress import log
from dfvs_core.errors import ConfigError
from dfvs_export.bundles.bundle import check_free, write_bundle
from dfvs_export.bundles.own_flow import NAME, OwnFlow
from dfvs_export.bundles.published_flow import PREFIX, PublishedFlow
from dfvs_export.checks.accuracy import accuracy, accuracy_figures
from dfvs_export.commands.comparison import calibration_frames, check_calibration
from dfvs_export.commands.network_size import network_size
from dfvs_export.precision.conversion import in_precision
from dfvs_export.weights.flow import load_weights
from dfvs_models.catalog import network_matcher
from dfvs_models.evaluation_file import read_flow_pairs
from dfvs_models.onnx_session import Execution

_OWN_SIZE, _PAIR_SIZE = (640, 480), (320, 240)


def run(arguments: argparse.Namespace) -> int:
    """Make a bundle of a network."""
    size = network_size(arguments.size) if arguments.size else None
    check_free(arguments.out)
    pairs = read_flow_pairs(arguments.pairs) if arguments.pairs else None
    check_calibration(arguments)
    size = size or (_OWN_SIZE if arguments.model == NAME else _PAIR_SIZE)
    network = named_matching_network(arguments)
    log(f"tracing {arguments.model} at {size[0]}x{size[1]}")
    bundle = network.bundle(size)
    if arguments.precision != "fp32":
        log(f"converting to {arguments.precision}")
        frames = calibration_frames(arguments, bundle) if arguments.precision == "int8" else []
        bundle = in_precision(bundle, arguments.precision, frames)
    scores = {}
    if pairs is not None:
        log(f"measuring accuracy on {arguments.pairs}")
        scores = accuracy(network_matcher(bundle, Execution()), pairs)
    card = network.card(bundle.manifest, scores, Path(arguments.pairs or "").name)
    write_bundle(arguments.out, bundle, card, accuracy_figures(scores))
    if arguments.model != NAME and arguments.weights is None and arguments.checkpoint is None:
        print("warning: these weights are random; name --weights to use the network")
    print(f"wrote {arguments.out}")
    return 0


def named_matching_network(arguments: argparse.Namespace) -> OwnFlow | PublishedFlow:
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
        return OwnFlow(load_weights(checkpoint))
    if not arguments.model.startswith(PREFIX):
        raise ConfigError(f"model {arguments.model!r}", f"{NAME!r} or '{PREFIX}NAME'")
    if checkpoint is not None and weights is not None:
        raise ConfigError("--checkpoint and --weights together", "one of them")
    if checkpoint is not None and not checkpoint.is_file():
        raise ConfigError(f"no checkpoint at {checkpoint}", "a file")
    source = weights if checkpoint is None else str(checkpoint)
    return PublishedFlow.load(arguments.model.removeprefix(PREFIX), source, digest)
