"""What ``dfvs-export pose`` does."""

import argparse

from dfvs_common.progress import log
from dfvs_export.bundles.bundle import check_free, write_bundle
from dfvs_export.bundles.pose import PoseModel
from dfvs_export.commands.comparison import agrees_with_torch
from dfvs_models.onnx_session import Execution
from dfvs_models.pose import PoseNetwork


def run(arguments: argparse.Namespace) -> int:
    """Make a bundle of a trained network; 1 where ONNX Runtime does not give what torch gives."""
    check_free(arguments.out)
    model = PoseModel.load(arguments.checkpoint)
    log(f"tracing {model.weights.name}")
    bundle = model.bundle()
    if not agrees_with_torch(model, bundle):
        return 1
    PoseNetwork(bundle, Execution())  # as the benchmark loads it: shapes, numbers
    write_bundle(arguments.out, bundle, model.card(bundle.manifest), {})
    print(f"wrote {arguments.out}")
    return 0
