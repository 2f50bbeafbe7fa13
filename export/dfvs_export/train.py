"""Training of dfvs-flow on wide-baseline pairs.

The matcher is trained with the loss of LightGlue: the log probability of true matches, and that of
unmatchable points being so. The encoder stays as it is, or its last blocks are trained with it.
Views are augmented on their own, and one of two is turned by the angle that the service would
turn it by.
"""

from __future__ import annotations

import math
import time
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
import torch
from torch import Tensor
from torch.nn import functional

from dfvs_core.errors import ConfigError
from dfvs_export.networks.xfeat import Keypoints, XFeat
from dfvs_export.own import KEYPOINTS
from dfvs_export.pairs import SIZE, PairReader, TrainingPair, true_matches
from dfvs_export.weights import Weights, load_weights, save_weights

_PAIRS_PER_STEP = 8
_WARM_UP_STEPS = 50
_ENCODER_RATE = 0.3
"""Learning rate of the encoder in that of the matcher."""
_PAIRS_PER_REPORT = 400
_LEAST_MATCHES = 4
_UNMATCHED_WEIGHT = 0.5


@dataclass(frozen=True, slots=True)
class TrainSettings:
    """What a training run is asked for; see ``dfvs-export train --help``."""

    pairs: Path
    out: Path
    start: Path | None
    minutes: float
    learning_rate: float
    encoder_blocks: int
    seed: int
    threads: int

    def __post_init__(self) -> None:
        """Refuse what trains nothing."""
        for name in ("minutes", "learning_rate", "threads"):
            if not getattr(self, name) > 0:
                raise ConfigError(f"{name} is {getattr(self, name)}", "more than 0")
        if not self.out.absolute().parent.is_dir():
            raise ConfigError(f"{self.out} lies in no folder", "an existing folder")


def train(settings: TrainSettings, say: Callable[[str], None]) -> None:
    """Train, write a checkpoint every few hundred pairs, and at the end.

    Raises
    ------
    ConfigError, ModelError
        If there are no pairs, or the weights to start from cannot be used.
    """
    torch.set_num_threads(settings.threads)
    reader = PairReader(settings.pairs, settings.seed)
    run = _Run(settings, load_weights(settings.start))
    began = time.monotonic()
    done = 0.0
    while done < 1.0:
        for _ in range(_PAIRS_PER_STEP):
            run.learn_from(reader.draw())
        done = (time.monotonic() - began) / (60.0 * settings.minutes)
        run.step(done)
        if run.pairs % _PAIRS_PER_REPORT == 0:
            say(run.report())
            run.save()
    run.save()


class _Run:
    """Networks in training, their optimiser, and the figures since the last report."""

    def __init__(self, settings: TrainSettings, start: Weights) -> None:
        self._settings, self._start = settings, start
        self._encoder, self._matcher = start.networks(SIZE, KEYPOINTS)
        self._encoder.requires_grad_(False)
        blocks = _last_blocks(self._encoder)[: settings.encoder_blocks]
        for block in blocks:
            block.requires_grad_(True)
        trained = [p for p in self._encoder.parameters() if p.requires_grad]
        rate = settings.learning_rate
        groups = [{"params": list(self._matcher.parameters()), "rate": rate}]
        if trained:
            groups.append({"params": trained, "rate": _ENCODER_RATE * rate})
        self._optimiser = torch.optim.AdamW(groups, lr=rate, weight_decay=1e-4)
        self._steps = 0
        self.pairs = 0
        self._figures: list[tuple[float, int, int, int]] = []

    def learn_from(self, pair: TrainingPair) -> None:
        """Add the gradient of one pair."""
        self.pairs += 1
        keypoints = [self._keypoints(image) for image in (pair.first.image, pair.second.image)]
        truth = true_matches(pair, *(k.points[0].numpy() for k in keypoints))
        found = self._matcher(*keypoints)
        losses = []
        if len(truth.first) >= _LEAST_MATCHES:
            losses.append(-found.log_probability[0, truth.first, truth.second].mean())
        for logit, unmatchable in (
            (found.first_matchable, truth.first_unmatchable),
            (found.second_matchable, truth.second_unmatchable),
        ):
            if unmatchable.any():
                unmatched = functional.softplus(logit[0, torch.from_numpy(unmatchable)]).mean()
                losses.append(_UNMATCHED_WEIGHT * unmatched)
        if losses:
            loss: Tensor = torch.stack(losses).sum()
            (loss / _PAIRS_PER_STEP).backward()  # type: ignore[no-untyped-call]
            partner = found.log_probability[0].argmax(dim=1)[truth.first].numpy()
            right = int(np.sum(partner == truth.second))
            self._figures.append((loss.item(), len(truth.first), right, 1))

    def step(self, done: float) -> None:
        """Take a step; ``done`` is the share of the run, by which the rate falls."""
        self._steps += 1
        rate = min(1.0, self._steps / _WARM_UP_STEPS) * 0.5 * (1.0 + math.cos(math.pi * done))
        for group in self._optimiser.param_groups:
            group["lr"] = rate * group["rate"]
        torch.nn.utils.clip_grad_norm_(self._matcher.parameters(), 1.0)
        self._optimiser.step()
        self._optimiser.zero_grad()

    def report(self) -> str:
        """One line about the pairs since the last report."""
        loss, true, right, count = np.sum(self._figures, axis=0) if self._figures else (0, 1, 0, 1)
        self._figures.clear()
        return f"{self.pairs} pairs: loss {loss / count:.3f}, {right / max(true, 1):.1%} right"

    def save(self) -> None:
        """Write the checkpoint."""
        s = self._settings
        line = (
            f"{self.pairs} wide-baseline pairs of rooms, {s.encoder_blocks} encoder blocks trained,"
            f" learning rate {s.learning_rate:g}, seed {s.seed}."
        )
        states: list[dict[str, Any]] = [n.state_dict() for n in (self._encoder, self._matcher)]
        origin = "XFeat and LighterGlue as published, trained on by this project"
        history = f"{self._start.training} Then: {line}"
        save_weights(s.out, Weights(states[0], states[1], origin, history))

    def _keypoints(self, image: Any) -> Keypoints:
        with torch.set_grad_enabled(self._settings.encoder_blocks > 0):
            found: Keypoints = self._encoder(torch.from_numpy(image)[None, None])
        return found


def _last_blocks(encoder: XFeat) -> list[torch.nn.Module]:
    """Blocks of the encoder from the last one backwards."""
    return [encoder.block_fusion, encoder.block5, encoder.block4, encoder.block3]
