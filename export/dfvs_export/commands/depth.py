"""What ``dfvs-export depth`` does."""

import argparse
from collections.abc import Mapping

from dfvs_common.progress import log
from dfvs_export.bundles.bundle import check_free, write_bundle
from dfvs_export.bundles.depth import OWN, DepthModel
from dfvs_export.commands.comparison import (
    agrees_with_torch,
    calibration_frames,
    check_calibration,
    compare_with_torch,
)
from dfvs_export.commands.network_size import network_size
from dfvs_export.precision.conversion import in_precision
from dfvs_export.weights.published_depth import DepthWeights
from dfvs_models.depth import DepthNetwork
from dfvs_models.depth_evaluation import MeasuredDepth, mean_score, measure_depth
from dfvs_models.evaluation_file import labelled
from dfvs_models.onnx_session import Execution


def run(arguments: argparse.Namespace) -> int:
    """Make a bundle of a depth network; 1 where ONNX Runtime does not give what torch gives."""
    size = network_size(arguments.size, 2) if arguments.size else None
    check_free(arguments.out)
    check_calibration(arguments)
    model = named_depth_model(arguments)
    log(f"tracing {arguments.model}")
    bundle = model.bundle(size, arguments.spread, arguments.scale_spread)
    if not agrees_with_torch(model, bundle, " of the range"):
        return 1
    if arguments.precision == "int8":
        log("converting to int8")
        bundle = in_precision(bundle, "int8", calibration_frames(arguments, bundle))
        found = compare_with_torch(model, bundle, 2)
        log(f"greatest difference from torch: {found.greatest:.1e}")
    network = DepthNetwork(bundle, Execution())  # as the service loads it: shapes, numbers
    paths = labelled(arguments.pairs)
    measured = {label: measure_depth(network, path) for label, path in paths.items()}
    card = model.card(bundle.manifest, measured)
    write_bundle(arguments.out, bundle, card, _figures(measured))
    if arguments.model != OWN and _weights(arguments).is_random:
        print("warning: these weights are random; name --checkpoint or --from to use the network")
    print(f"wrote {arguments.out}")
    return 0


def named_depth_model(arguments: argparse.Namespace) -> DepthModel:
    """The depth network that ``--model`` and the weights name.

    Raises
    ------
    ConfigError, ModelError
        If it or its weights cannot be used.
    """
    return DepthModel.load(arguments.model, _weights(arguments))


def _weights(arguments: argparse.Namespace) -> DepthWeights:
    return DepthWeights(arguments.checkpoint, arguments.folder, arguments.sha256)


def _figures(measured: Mapping[str, MeasuredDepth]) -> dict[str, float]:
    """What the manifest says of accuracy: means over the files."""
    if not measured:
        return {}
    scores = mean_score([result.score for result in measured.values()])
    figures = {"aligned_abs_rel": scores.aligned.abs_rel}
    if scores.metric is not None and scores.scale_log is not None:
        figures |= {"metric_abs_rel": scores.metric.abs_rel, "scale_log": scores.scale_log}
    return figures
