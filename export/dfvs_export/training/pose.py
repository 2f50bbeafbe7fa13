"""Training of the networks that regress poses."""

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from typing import Any, NamedTuple

import numpy as np
import torch
from torch import Tensor

from dfvs_core.geometry.arrays import Float32Array
from dfvs_core.geometry.poses import so3_log
from dfvs_export.networks.pose_regression import PoseNet
from dfvs_export.networks.siamese_pose import SiameseNet
from dfvs_export.training.descent import ENCODER_RATE, TrainSettings, descend, drawn_ahead
from dfvs_export.training.drawn_flows import stacked
from dfvs_export.training.planar_pairs import PlanarPoseReader
from dfvs_export.training.pose_loss import PoseBatch, PoseErrors, siamese_loss, stacked_loss
from dfvs_export.training.pose_pairs import RoomPoseReader
from dfvs_export.weights.checkpoint import state_of
from dfvs_export.weights.pose import TrainedPose, starting_weights

_PAIRS_PER_STEP = 16
_FROZEN_BLOCKS = 5
_STEPS_PER_REPORT, _STEPS_PER_CHECKPOINT = 25, 200


class _Training(NamedTuple):
    """Pairs to learn from, what they are, and the loss of a batch of them."""

    reader: type[RoomPoseReader | PlanarPoseReader]
    pairs: str
    loss: Callable[[Any, PoseBatch, np.random.Generator], tuple[Tensor, PoseErrors]]


_TRAININGS: Mapping[str, _Training] = {
    "saxena": _Training(RoomPoseReader, "pairs of views of rooms", stacked_loss),
    "bateux": _Training(
        PlanarPoseReader, "pairs of views of a plane with a view of a room on it", siamese_loss
    ),
}


@dataclass(frozen=True, slots=True, kw_only=True)
class PoseTrainSettings(TrainSettings):
    """What a training run is asked for; see ``dfvs-export train-pose --help``."""

    network: str


def train_pose(settings: PoseTrainSettings) -> None:
    """Train, write a checkpoint every 200 steps, and at the end.

    The encoder of ImageNet keeps its first blocks and the statistics of its normalisation.

    Raises
    ------
    ConfigError, ModelError
        If there are no pairs, or the weights to start from cannot be used.
    """
    start = starting_weights(settings.network, settings.start)
    network = start.network().to(memory_format=torch.channels_last)  # type: ignore[call-overload]
    training = _TRAININGS[settings.network]
    reader = training.reader(settings.pairs, settings.seed)
    batches = drawn_ahead(lambda: _batch(reader))
    rng = np.random.default_rng([settings.seed, 1])
    errors = list[PoseErrors]()

    def learn() -> None:
        loss, off = training.loss(network, next(batches), rng)
        loss.backward()  # type: ignore[no-untyped-call]
        errors.append(off)

    def report(steps: int) -> None:
        t, r, flow = np.mean(np.array(errors), axis=0)
        print(
            f"{_PAIRS_PER_STEP * steps} pairs: off by {t:.3f} depths,"
            f" {np.degrees(r):.2f} deg, flow {flow:.4f} widths",
            flush=True,
        )
        errors.clear()

    def save(steps: int) -> None:
        told = settings.history(start.training, f"{_PAIRS_PER_STEP * steps} {training.pairs}")
        TrainedPose(settings.network, state_of(network), start.origin, told).save(settings.out)

    descend(
        settings,
        _begin_training(network),
        learn,
        {report: _STEPS_PER_REPORT, save: _STEPS_PER_CHECKPOINT},
    )


def _begin_training(network: PoseNet) -> dict[torch.nn.Module, float]:
    """Let a network learn, but for the first blocks of an encoder; rates of learning by module."""
    network.train()
    if not isinstance(network, SiameseNet):
        return {network: 1.0}
    network.encoder.eval()
    network.encoder.freeze(_FROZEN_BLOCKS)
    return {network.encoder: ENCODER_RATE, network: 1.0}


def _batch(reader: RoomPoseReader | PlanarPoseReader) -> PoseBatch:
    pairs = [reader.draw() for _ in range(_PAIRS_PER_STEP)]
    poses = [pair.T_first_second for pair in pairs]
    return PoseBatch(
        _images([pair.first for pair in pairs]),
        _images([pair.second for pair in pairs]),
        stacked([np.array([pair.focal]) for pair in pairs]),
        stacked([T[:3, 3] for T in poses]),
        stacked([so3_log(T[:3, :3]) for T in poses]),
        torch.from_numpy(np.stack([pair.flow for pair in pairs])).permute(0, 3, 1, 2),
    )


def _images(images: list[Float32Array]) -> Tensor:
    tensor = torch.from_numpy(np.stack(images))[:, None]
    return tensor.contiguous(memory_format=torch.channels_last)
