"""Checkpoints: weights, their running average, the optimiser's state and how they came about."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import Any

import torch
from torch import Tensor, nn

from dfvs_core.errors import ModelError
from dfvs_export.networks.architecture import FlowArchitecture
from dfvs_export.networks.dfvs_flow import DfvsFlow

_MOST_WIDE = 4096
_SETTINGS = frozenset(
    {"steps", "minutes", "size", "pairs_per_step", "learning_rate", "precision", "seed"}
)
"""What a model card tells of a run."""


@dataclass(frozen=True, slots=True)
class Checkpoint:
    """What a training run leaves behind.

    Parameters
    ----------
    weights, average : dict
        State of the network, and its exponential average (which is what gets exported).
    optimiser : dict
        State of the optimiser; empty where it was left out, as of the shipped weights.
    step : int
        Steps taken, over all runs that led here.
    origin : tuple of dict
        Settings of those runs, oldest first.
    architecture : FlowArchitecture
        Sizes of the network.
    notes : str
        What a model card has to say of the pairs besides.
    """

    weights: dict[str, Any]
    average: dict[str, Any]
    optimiser: dict[str, Any]
    step: int
    origin: tuple[dict[str, Any], ...]
    architecture: FlowArchitecture
    notes: str = ""

    def __post_init__(self) -> None:
        """Refuse what no training wrote."""
        sizes = [getattr(self.architecture, name) for name in FlowArchitecture.__slots__]
        if not all(isinstance(n, int) and 0 < n <= _MOST_WIDE for n in sizes):
            raise ValueError(f"its architecture is {self.architecture}")
        for state in (self.weights, self.average):
            kinds = {v.dtype if isinstance(v, Tensor) else None for v in state.values()}
            if not kinds <= {torch.float32, torch.int64}:
                raise ValueError("its weights are no tensors of float32")
        if not all(run["settings"].keys() >= _SETTINGS for run in self.origin):
            raise ValueError("it does not tell of its training")


def save_checkpoint(path: Path, checkpoint: Checkpoint) -> None:
    """Write a checkpoint whole or not at all."""
    part = path.with_suffix(".part")
    fields = {name: getattr(checkpoint, name) for name in Checkpoint.__slots__}
    fields["architecture"] = {
        name: getattr(checkpoint.architecture, name) for name in FlowArchitecture.__slots__
    }
    fields["origin"] = list(checkpoint.origin)
    torch.save(fields, part)
    part.replace(path)


def load_checkpoint(path: Path) -> Checkpoint:
    """Read a checkpoint without running any code that it may hold.

    Raises
    ------
    ModelError
        If the file is missing, is no checkpoint of ours, or holds anything but plain data.
    """
    if not path.is_file():
        raise ModelError(f"no checkpoint at {path}", "a file that the training wrote")
    try:
        fields = torch.load(path, map_location="cpu", weights_only=True)
        architecture = FlowArchitecture(**fields.pop("architecture"))
        fields["origin"] = tuple(fields["origin"])
        return Checkpoint(architecture=architecture, **fields)
    except Exception as error:  # torch raises a dozen kinds for a bad file
        raise ModelError(
            f"{path} is no checkpoint: {type(error).__name__}", "a file that the training wrote"
        ) from error


def load_network(path: Path) -> DfvsFlow:
    """Return the averaged network of a checkpoint, ready to run.

    Raises
    ------
    ModelError
        If the file is no checkpoint, or its weights do not fit.
    """
    checkpoint = load_checkpoint(path)
    network = DfvsFlow(checkpoint.architecture)
    fill(network, checkpoint.average)
    return network.eval()


def fill(network: DfvsFlow, state: dict[str, Any]) -> None:
    """Give a network weights.

    Raises
    ------
    ModelError
        If they do not fit.
    """
    try:
        network.load_state_dict(state)
    except RuntimeError as error:
        raise ModelError(
            "the checkpoint does not fit the network", "weights of dfvs-flow"
        ) from error


class RunningAverage:
    """Exponential average of a network's weights; buffers are copied as they are."""

    def __init__(self, network: nn.Module, decay: float) -> None:
        self._decay = decay
        self.state = {name: value.detach().clone() for name, value in network.state_dict().items()}

    def follow(self, network: nn.Module, step: int) -> None:
        """Take one step towards the network's weights; early steps are larger."""
        decay = min(self._decay, (1.0 + step) / (10.0 + step))
        with torch.no_grad():
            for name, value in network.state_dict().items():
                if value.dtype.is_floating_point:
                    self.state[name].lerp_(value, 1.0 - decay)
                else:
                    self.state[name].copy_(value)
