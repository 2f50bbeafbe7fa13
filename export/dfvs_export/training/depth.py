"""Training of dfvs-depth on views with depth."""

from dataclasses import dataclass

import numpy as np
import torch
from torch import Tensor

from dfvs_export.training.depth_loss import Truth, depth_loss
from dfvs_export.training.depth_views import DepthViewReader
from dfvs_export.training.descent import (
    ENCODER_RATE,
    TrainSettings,
    bfloat16_where_quick,
    descend,
    drawn_ahead,
)
from dfvs_export.weights.checkpoint import state_of
from dfvs_export.weights.depth import TrainedDepth, load_depth_weights

_VIEWS_PER_STEP = 8
_STEPS_PER_REPORT = 50


@dataclass(frozen=True, slots=True, kw_only=True)
class DepthTrainSettings(TrainSettings):
    """What a training run is asked for; see ``dfvs-export train-depth --help``."""

    frozen_blocks: int


def train_depth(settings: DepthTrainSettings) -> None:
    """Train, print the loss and write a checkpoint every few hundred views, and at the end.

    The encoder's batch normalisation keeps its statistics.

    Raises
    ------
    ConfigError, ModelError
        If there are no views, or the weights to start from cannot be used.
    """
    start = load_depth_weights(settings.start)
    network = start.network()
    network.to(memory_format=torch.channels_last)  # type: ignore[call-overload]
    network.train()
    network.encoder.eval()
    network.encoder.freeze(settings.frozen_blocks)
    rates = {network.encoder: ENCODER_RATE, network: 1.0}
    reader = DepthViewReader(settings.pairs, settings.seed)
    batches = drawn_ahead(lambda: _batch(reader))
    losses = list[float]()

    def learn() -> None:
        image, focal, truth = next(batches)
        with bfloat16_where_quick():
            found = network.logs(image, focal)
        loss = depth_loss(found, truth)
        loss.backward()  # type: ignore[no-untyped-call]
        losses.append(loss.item())

    def report(steps: int) -> None:
        print(f"{_VIEWS_PER_STEP * steps} views: loss {np.mean(losses):.3f}", flush=True)
        losses.clear()

    def save(steps: int) -> None:
        frozen = f"the first {settings.frozen_blocks} blocks of the encoder frozen"
        what = f"{_VIEWS_PER_STEP * steps} views of rooms, {frozen}"
        training = settings.history(start.training, what)
        TrainedDepth(state_of(network), start.origin, training).save(settings.out)

    descend(settings, rates, learn, {report: _STEPS_PER_REPORT, save: _STEPS_PER_REPORT})


def _batch(reader: DepthViewReader) -> tuple[Tensor, Tensor, Truth]:
    views = [reader.draw() for _ in range(_VIEWS_PER_STEP)]
    grey = torch.from_numpy(np.stack([v.image for v in views]))
    depth = torch.from_numpy(np.stack([v.depth_m for v in views]))
    normals = torch.from_numpy(np.stack([v.normals for v in views])).permute(0, 3, 1, 2)
    focal = torch.tensor([[v.focal] for v in views])
    return grey[:, None].expand(-1, 3, -1, -1), focal, Truth(depth, normals)
