"""What ``dfvs-export flow``, ``check`` and ``bench`` do."""

from __future__ import annotations

import argparse
import json
from pathlib import Path

from dfvs_core.errors import ConfigError, ModelError
from dfvs_export.bench import bench
from dfvs_export.bundles import BundleText, read_bundle, write_flow_bundle
from dfvs_export.card import model_card
from dfvs_export.check import accuracy, accuracy_figures, drawn_pairs, operators, parity
from dfvs_export.foreign import PREFIX, ForeignWeights, write_foreign_bundle
from dfvs_export.graphs import to_onnx
from dfvs_export.quantise import quantise
from dfvs_export.running import FlowRunner
from dfvs_export.train.checkpoint import load_checkpoint, load_network

_CALIBRATION_SEED = 900_001
_PARITY_SEED = 900_002
PARITY_LIMIT_PX = 1e-3


def run_flow(arguments: argparse.Namespace, size: tuple[int, int]) -> int:
    """Make a bundle of dfvs-flow from a checkpoint.

    Raises
    ------
    ConfigError, ModelError
        If the model is unknown or the checkpoint cannot be used.
    """
    if arguments.model.startswith(PREFIX):
        return _run_foreign(arguments, size)
    if arguments.model != "dfvs-flow":
        raise ConfigError(f"model {arguments.model!r}", f"'dfvs-flow' or '{PREFIX}NAME'")
    if arguments.checkpoint is None:
        raise ConfigError("no checkpoint given", "--checkpoint FILE.pt of a training run")
    checkpoint = load_checkpoint(arguments.checkpoint)
    onnx_pair = to_onnx(load_network(arguments.checkpoint), size)
    name = "dfvs-flow" if arguments.precision == "fp32" else f"dfvs-flow-{arguments.precision}"
    origin = f"trained by this project from scratch on drawn rooms, {checkpoint.step} steps"
    text = BundleText(name, origin, {}, "")
    write_flow_bundle(arguments.out, onnx_pair, size, text)
    if arguments.precision == "int8":
        frames = drawn_pairs(size, arguments.calibration_pairs, _CALIBRATION_SEED)
        runner = FlowRunner(*read_bundle(arguments.out))
        onnx_pair = quantise(onnx_pair, runner, frames)
        write_flow_bundle(arguments.out, onnx_pair, size, text)
    scores = {}
    if arguments.pairs:
        scores = accuracy(FlowRunner(*read_bundle(arguments.out)), arguments.pairs)
    card = model_card(
        checkpoint, size, arguments.precision, scores, Path(arguments.pairs or "").name
    )
    text = BundleText(name, origin, accuracy_figures(scores), card)
    write_flow_bundle(arguments.out, onnx_pair, size, text)
    print(f"wrote {arguments.out}")
    return 0


def _run_foreign(arguments: argparse.Namespace, size: tuple[int, int]) -> int:
    """Convert a published network.

    Raises
    ------
    ConfigError
        If another precision is asked for than its own.
    """
    if arguments.precision != "fp32":
        raise ConfigError(f"precision {arguments.precision!r}", "fp32 for published networks")
    weights = ForeignWeights(arguments.weights, arguments.sha256)
    name = arguments.model.removeprefix(PREFIX)
    write_foreign_bundle(arguments.out, name, size, weights)
    if arguments.weights is None:
        print("warning: these weights are random; name --weights to use the network")
    print(f"wrote {arguments.out}")
    return 0


def run_check(arguments: argparse.Namespace) -> int:
    """Check a bundle; 1 where torch and ONNX Runtime differ by more than the limit on average."""
    manifest, contents = read_bundle(arguments.bundle)
    report: dict[str, object] = {
        "bundle": manifest.name,
        "files": "all as announced",
        "operators": dict(operators(contents)),
    }
    runner = FlowRunner(manifest, contents)
    agrees = True
    if arguments.checkpoint:
        size = (manifest.input.width, manifest.input.height)
        pairs = drawn_pairs(size, arguments.count, _PARITY_SEED)
        found = parity(load_network(arguments.checkpoint), runner, pairs)
        report |= {
            "greatest_difference_px": found.greatest_px,
            "mean_difference_px": found.mean_px,
        }
        agrees = found.mean_px <= PARITY_LIMIT_PX
    if arguments.pairs:
        report["accuracy"] = accuracy_figures(accuracy(runner, arguments.pairs))
    print(json.dumps(report, indent=None if arguments.json else 2))
    return 0 if agrees else 1


def run_bench(arguments: argparse.Namespace, size: tuple[int, int]) -> int:
    """Measure bundles side by side.

    Raises
    ------
    ModelError
        If the results cannot be written.
    """
    results = bench(arguments.bundles, size, arguments.threads, arguments.runs)
    for r in results:
        print(f"{r.bundle:24} {r.precision}  median {r.median_ms:7.1f} ms  p99 {r.p99_ms:7.1f} ms")
    if arguments.json:
        try:
            arguments.json.write_text(json.dumps([r.as_json() for r in results], indent=2) + "\n")
        except OSError as error:
            raise ModelError(f"cannot write {arguments.json} ({error.strerror})") from error
    return 0
