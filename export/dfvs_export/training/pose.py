"""Training of the networks that regress poses."""

from collections.abc import Mapping
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
import torch
from torch import Tensor
from torch.nn import functional

from dfvs_core.geometry.arrays import Float32Array, FloatArray
from dfvs_core.geometry.poses import quaternion_from_rotation, so3_log
from dfvs_export.networks.pose_regression import PoseNet, PosePrediction, SiameseNet
from dfvs_export.training.descent import ENCODER_RATE, TrainSettings, descend, drawn_ahead
from dfvs_export.training.planar_pairs import PlanarPoseReader
from dfvs_export.training.pose_pairs import RoomPoseReader
from dfvs_export.weights.checkpoint import state_of
from dfvs_export.weights.pose import TrainedPose, starting_weights

_PAIRS_PER_STEP = 16
_FROZEN_BLOCKS = 5
_STEPS_PER_REPORT, _STEPS_PER_CHECKPOINT = 25, 200
_ROTATION_WEIGHT = {"quaternion": 4.0, "vector": 1.0}
"""Of the error of the rotation beside that of the translation."""
_FLOW_WEIGHT = 2.0

_READERS: Mapping[str, tuple[type[RoomPoseReader | PlanarPoseReader], str]] = {
    "saxena": (RoomPoseReader, "pairs of views of rooms"),
    "bateux": (PlanarPoseReader, "pairs of views of a plane with a view of a room on it"),
}


@dataclass(frozen=True, slots=True, kw_only=True)
class PoseTrainSettings(TrainSettings):
    """What a training run is asked for; see ``dfvs-export train-pose --help``."""

    network: str


class _Batch(NamedTuple):
    """Tensors of some pairs; ``rotation`` is a quaternion or a vector, as the network gives."""

    first: Tensor
    second: Tensor
    focal: Tensor
    translation: Tensor
    rotation: Tensor
    flow: Tensor


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
    make_reader, what = _READERS[settings.network]
    reader = make_reader(settings.pairs, settings.seed)
    batches = drawn_ahead(lambda: _batch(reader, network))
    errors = list[tuple[float, float, float]]()

    def report(steps: int) -> None:
        t, r, flow = np.mean(errors, axis=0)
        print(
            f"{_PAIRS_PER_STEP * steps} pairs: off by {t:.3f} {network.unit},"
            f" {np.degrees(r):.2f} deg, flow {flow:.3f} widths",
            flush=True,
        )
        errors.clear()

    def save(steps: int) -> None:
        training = settings.history(start.training, f"{_PAIRS_PER_STEP * steps} {what}")
        weights = TrainedPose(settings.network, state_of(network), start.origin, training)
        weights.save(settings.out)

    descend(
        settings,
        _begin_training(network),
        lambda: errors.append(_learn(network, next(batches))),
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


def _learn(network: PoseNet, batch: _Batch) -> tuple[float, float, float]:
    """Add the gradient of a batch; mean errors of translation, of rotation in rad, of flow."""
    with torch.autocast("cpu", torch.bfloat16):
        features, flow = network.encode(batch.first, batch.second)
    found = network.regress(features.float(), flow.float(), batch.focal)
    t_error = _distance(found.translation, batch.translation)
    r_error = _rotation_error(found, batch, network.rotation)
    known = ~batch.flow.isnan()
    apart = functional.smooth_l1_loss(
        flow.float(), batch.flow.nan_to_num(), reduction="none", beta=0.02
    )
    flow_error = torch.where(known, apart, 0.0).sum() / known.sum().clamp(min=1)
    weight = _ROTATION_WEIGHT[network.rotation]
    loss = t_error + weight * r_error + _FLOW_WEIGHT * flow_error
    loss.backward()  # type: ignore[no-untyped-call]
    to_rad = 2.0 if network.rotation == "quaternion" else 1.0  # of a small one's half angle
    return t_error.item(), to_rad * r_error.item(), flow_error.item()


def _rotation_error(found: PosePrediction, batch: _Batch, rotation: str) -> Tensor:
    """Mean distance of quaternions (that of Saxena et al.) or of rotation vectors."""
    given = found.rotation
    if rotation == "quaternion":
        given = functional.normalize(given, dim=1)
    return _distance(given, batch.rotation)


def _distance(a: Tensor, b: Tensor) -> Tensor:
    mean: Tensor = torch.linalg.vector_norm(a - b, dim=1).mean()
    return mean


def _batch(reader: RoomPoseReader | PlanarPoseReader, network: PoseNet) -> _Batch:
    pairs = [reader.draw() for _ in range(_PAIRS_PER_STEP)]
    rotation_of = quaternion_from_rotation if network.rotation == "quaternion" else so3_log
    poses = [pair.T_first_second for pair in pairs]
    return _Batch(
        _images([pair.first for pair in pairs]),
        _images([pair.second for pair in pairs]),
        _tensor([np.array([pair.focal]) for pair in pairs]),
        _tensor([T[:3, 3] for T in poses]),
        _tensor([rotation_of(T[:3, :3]) for T in poses]),
        torch.from_numpy(np.stack([pair.flow for pair in pairs])).permute(0, 3, 1, 2),
    )


def _images(images: list[Float32Array]) -> Tensor:
    tensor = torch.from_numpy(np.stack(images))[:, None]
    return tensor.contiguous(memory_format=torch.channels_last)


def _tensor(rows: list[FloatArray]) -> Tensor:
    return torch.from_numpy(np.stack(rows).astype(np.float32))
