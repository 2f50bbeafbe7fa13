"""What ``dfvs-export pose`` does, and ``check`` with a pose bundle."""

from __future__ import annotations

import argparse
import json

import numpy as np
import torch

from dfvs_core.errors import ConfigError, ModelError
from dfvs_core.messages.manifest import Manifest
from dfvs_core.messages.network_tensors import ImageInput, PoseOutput
from dfvs_export.bundles import (
    POSE_INPUTS,
    POSE_OUTPUTS,
    Source,
    check_free,
    described,
    pose_bundle,
    write_bundle,
)
from dfvs_export.check import drawn_pairs, operators
from dfvs_export.graphs import trace
from dfvs_export.networks.pose_regression import SIZE, PoseNet
from dfvs_export.pose_weights import TrainedPose, load_pose_weights
from dfvs_export.progress import say
from dfvs_export.running import FOCAL, BundleRunner
from dfvs_models.bundle import Bundle
from dfvs_models.onnx_session import Execution
from dfvs_models.pose import PoseNetwork

PARITY_LIMIT = 1e-3
"""Greatest difference in fp32 between torch and ONNX Runtime, m, depths, rad or of a quaternion."""
_PARITY_PAIRS, _PARITY_SEED = 2, 900_005
_AFTER = {
    "saxena": "Saxena et al. (ICRA 2017): FlowNet's encoder on both images stacked",
    "bateux": "Bateux et al. (ICRA 2018): a Siamese encoder of ImageNet, trained on planes",
}
_CARD = """# {name}

Pose of a goal image's camera in the current one's, from both images; a baseline of the benchmark,
after {after}.

- Input: two grey images of {width} x {height} px, and their focal length over the width.
- Output: translation ({unit}) and rotation ({rotation}). Precision: {precision}.
- {parameters:.2f} million parameters. Origin: {origin}.
- Licence: {licence}.

## Training
{training}

## Accuracy
Not measured for this bundle: see `dfvs-bench scenes --setting` and `table1`.

## What it is bad at
- Views that share little, and motion beyond that of its training.
- The unit of its translation: {scale}.
"""
_SCALES = {
    "m": "lengths are guessed from what rooms of the training look like",
    "depth": "lengths come in depths at the goal's middle, as if all were one plane",
}


def run_pose(arguments: argparse.Namespace) -> int:
    """Make a bundle of a trained network; 1 where ONNX Runtime does not give what torch gives.

    Raises
    ------
    ConfigError, ModelError
        If the weights or the folder cannot be used.
    """
    check_free(arguments.out)
    weights = load_pose_weights(arguments.checkpoint)
    network = weights.network()
    say(f"tracing {weights.name}")
    bundle = _bundle(weights, network)
    found = parity(network, bundle, _PARITY_PAIRS)
    say(f"greatest difference from torch: {found:.1e}")
    if not found <= PARITY_LIMIT:
        print(f"not written: ONNX Runtime differs from torch by {found:.1e}")
        return 1
    PoseNetwork(bundle, Execution())  # as the benchmark loads it: shapes, numbers
    write_bundle(arguments.out, described(bundle, _card(weights, bundle.manifest), {}))
    print(f"wrote {arguments.out}")
    return 0


def _bundle(weights: TrainedPose, network: PoseNet) -> Bundle:
    width, height = SIZE
    images = torch.rand(2, 1, height, width, generator=torch.Generator().manual_seed(0))
    example = (images[:1], images[1:], torch.full((1, 1), FOCAL))
    onnx = trace(network, example, (POSE_INPUTS, POSE_OUTPUTS))
    picture = ImageInput(width, height, 16, channels="grey", mean=(0.5,), std=(0.5,))
    meaning = PoseOutput(network.unit, network.rotation)
    origin = f"{weights.origin}, trained by this project, weights {weights.digest}"
    return pose_bundle(onnx, picture, meaning, Source(weights.name, origin, "Apache-2.0"))


def parity(network: PoseNet, bundle: Bundle, count: int) -> float:
    """Greatest difference of a bundle's outputs from torch's on drawn images.

    Raises
    ------
    ModelError
        If either gives values that are not finite.
    """
    runner = BundleRunner(bundle)
    apart = []
    for pair in drawn_pairs(SIZE, count, _PARITY_SEED):
        first, second = (runner.encode(image) for image in pair)
        tensors = [torch.from_numpy(t) for t in (first[0], second[0], first[1])]
        with torch.no_grad():
            expected = network(*tensors)
        found = runner.match(first, second)
        apart += [np.abs(a - b.numpy()).max() for a, b in zip(found, expected, strict=True)]
    if not np.isfinite(apart).all():
        raise ModelError("torch or ONNX Runtime gives values that are not finite", "a finite pose")
    return float(max(apart))


def check_pose(arguments: argparse.Namespace, bundle: Bundle) -> int:
    """Check a pose bundle; 1 where torch and ONNX Runtime differ.

    Raises
    ------
    ConfigError, ModelError
        If the bundle, or what it is to be compared with, cannot be used.
    """
    if arguments.pairs or arguments.reference:
        raise ConfigError("--pairs or --reference with a pose bundle", "a bundle of flow")
    report: dict[str, object] = {
        "bundle": bundle.manifest.name,
        "precision": bundle.manifest.precision,
        "files": "all as announced",
        "operators": dict(operators(bundle.contents)),
    }
    PoseNetwork(bundle, Execution())  # as the benchmark loads it: shapes, numbers
    holds = True
    if arguments.checkpoint is None:
        report["torch"] = "not compared: name the weights (--checkpoint)"
    else:
        say(f"comparing with torch on {arguments.count} drawn pairs")
        network = load_pose_weights(arguments.checkpoint).network()
        found = parity(network, bundle, arguments.count)
        report["greatest_difference"] = found
        holds = found <= PARITY_LIMIT
    print(json.dumps(report, indent=None if arguments.json else 2))
    return 0 if holds else 1


def _card(weights: TrainedPose, manifest: Manifest) -> str:
    meaning = manifest.pose
    assert meaning is not None
    return _CARD.format(
        name=weights.name,
        after=_AFTER[weights.name],
        width=manifest.input.width,
        height=manifest.input.height,
        unit=meaning.unit,
        rotation="rotation vector" if meaning.rotation == "vector" else "quaternion",
        precision=manifest.precision,
        parameters=sum(value.numel() for value in weights.state.values()) / 1e6,
        origin=manifest.origin,
        licence=manifest.licence,
        training=weights.training,
        scale=_SCALES[meaning.unit],
    )
