"""Training of dfvs-depth on views with depth."""

from __future__ import annotations

import time
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import torch
from torch import Tensor

from dfvs_export.training.depth_loss import Truth, depth_loss
from dfvs_export.training.depth_views import DepthViewReader
from dfvs_export.training.descent import Descent, check_training, drawn_ahead
from dfvs_export.training.room_pairs import RoomFolder
from dfvs_export.weights.depth import TrainedDepth, load_depth_weights, save_depth_weights

_VIEWS_PER_STEP = 8
_ENCODER_RATE = 0.3
"""Learning rate of the encoder in that of the decoder."""
_STEPS_PER_REPORT = 50


@dataclass(frozen=True, slots=True)
class DepthTrainSettings:
    """What a training run is asked for; see ``dfvs-export train-depth --help``."""

    pairs: Path
    out: Path
    start: Path
    minutes: float
    learning_rate: float
    frozen_blocks: int
    seed: int
    threads: int

    def __post_init__(self) -> None:
        """Refuse what trains nothing."""
        check_training(self, self.out, ("minutes", "learning_rate", "threads"))


def train_depth(settings: DepthTrainSettings, log: Callable[[str], None]) -> None:
    """Train, write a checkpoint every few hundred views, and at the end.

    The encoder's batch normalisation keeps its statistics.

    Raises
    ------
    ConfigError, ModelError
        If there are no views, or the weights to start from cannot be used.
    """
    torch.set_num_threads(settings.threads)
    start = load_depth_weights(settings.start)
    network = start.network()
    network.to(memory_format=torch.channels_last)  # type: ignore[call-overload]
    network.train()
    network.encoder.eval()
    network.encoder.freeze(settings.frozen_blocks)
    rates = {
        network.encoder: settings.learning_rate * _ENCODER_RATE,
        network: settings.learning_rate,
    }
    descent = Descent(rates)
    reader = DepthViewReader(RoomFolder(settings.pairs), settings.seed)
    began, steps, done, losses = time.monotonic(), 0, 0.0, list[float]()
    batches = drawn_ahead(lambda: _batch(reader))
    while done < 1.0:
        image, focal, truth = next(batches)
        with torch.autocast("cpu", torch.bfloat16):
            found = network.logs(image, focal)
        loss = depth_loss(found, truth)
        loss.backward()  # type: ignore[no-untyped-call]
        steps += 1
        descent.step(done)
        done = (time.monotonic() - began) / (60.0 * settings.minutes)
        losses.append(loss.item())
        if steps % _STEPS_PER_REPORT == 0 or done >= 1.0:
            log(f"{_VIEWS_PER_STEP * steps} views: loss {np.mean(losses):.3f}")
            losses.clear()
            line = (
                f"{_VIEWS_PER_STEP * steps} views of rooms, the first {settings.frozen_blocks}"
                f" blocks of the encoder frozen, learning rate {settings.learning_rate:g}, seed"
                f" {settings.seed}."
            )
            state = {k: v.contiguous() for k, v in network.state_dict().items()}
            save_depth_weights(
                settings.out, TrainedDepth(state, start.origin, f"{start.training} Then: {line}")
            )


def _batch(reader: DepthViewReader) -> tuple[Tensor, Tensor, Truth]:
    views = [reader.draw() for _ in range(_VIEWS_PER_STEP)]
    grey = torch.from_numpy(np.stack([v.image for v in views]))
    depth = torch.from_numpy(np.stack([v.depth_m for v in views]))
    normals = torch.from_numpy(np.stack([v.normals for v in views])).permute(0, 3, 1, 2)
    focal = torch.tensor([[v.focal] for v in views])
    return grey[:, None].expand(-1, 3, -1, -1), focal, Truth(depth, normals)
