"""Training of dfvs-flow on wide-baseline pairs.

The matcher is trained with the loss of LightGlue: the log probability of true matches, and that of
unmatchable points being so. The encoder stays as it is, or its last blocks are trained with it.
Views are augmented on their own, and one of two is turned by the angle that the service would
turn it by. While the encoder stays as it is, encoded pairs are kept and learnt from again.
"""

from dataclasses import dataclass
from typing import Any

import numpy as np
import torch
from torch import Tensor
from torch.nn import functional

from dfvs_export.networks.xfeat import Keypoints
from dfvs_export.training.descent import (
    ENCODER_RATE,
    TrainSettings,
    bfloat16_where_quick,
    descend,
)
from dfvs_export.training.room_pairs import SIZE, PairReader, TrueMatches, true_matches
from dfvs_export.weights.checkpoint import state_of
from dfvs_export.weights.flow import Weights, load_weights

_PAIRS_PER_STEP = 8
_STEPS_PER_REPORT = 50
_LEAST_MATCHES = 4
_UNMATCHED_WEIGHT = 0.5
_LEAST_KEPT, _MOST_KEPT = 400, 6000
_NEW = 0.3
"""Share of pairs that are drawn anew when encoded ones are kept."""


@dataclass(frozen=True, slots=True)
class EncodedPair:
    """Keypoints of both views of a pair, and their true matches."""

    first: Keypoints
    second: Keypoints
    truth: TrueMatches


@dataclass(frozen=True, slots=True, kw_only=True)
class FlowTrainSettings(TrainSettings):
    """What a training run is asked for; see ``dfvs-export train --help``."""

    encoder_blocks: int
    keypoints: int

    POSITIVE = (*TrainSettings.POSITIVE, "keypoints")


def train(settings: FlowTrainSettings) -> None:
    """Train, print the loss and write a checkpoint every few hundred pairs, and at the end.

    Raises
    ------
    ConfigError, ModelError
        If there are no pairs, or the weights to start from cannot be used.
    """
    run = _Run(settings, load_weights(settings.start))
    descend(
        settings, run.rates, run.learn, {run.report: _STEPS_PER_REPORT, run.save: _STEPS_PER_REPORT}
    )


class _Run:
    """Networks in training, and the figures since the last report."""

    def __init__(self, settings: FlowTrainSettings, start: Weights) -> None:
        self._settings, self._start = settings, start
        self._reader = PairReader(settings.pairs, settings.seed)
        self._rng = np.random.default_rng([settings.seed, 1])
        self._kept: list[EncodedPair] = []
        self._encoder, self._matcher = start.networks(SIZE, settings.keypoints)
        self._encoder.requires_grad_(False)
        e = self._encoder
        for block in (e.block_fusion, e.block5, e.block4, e.block3)[: settings.encoder_blocks]:
            block.requires_grad_(True)
        self.rates = {self._matcher: 1.0, self._encoder: ENCODER_RATE}
        self._figures: list[tuple[float, int, int, int]] = []

    def _draw(self) -> EncodedPair:
        """Draw the next pair: a new one, or one that was kept."""
        keep = self._settings.encoder_blocks == 0
        if keep and len(self._kept) > _LEAST_KEPT and self._rng.uniform() > _NEW:
            return self._kept[self._rng.integers(len(self._kept))]
        pair = self._reader.draw()
        first, second = (self._keypoints(view.image) for view in (pair.first, pair.second))
        if not (first.points.numel() and second.points.numel()):
            return self._draw()
        truth = true_matches(pair, *(k.points[0].numpy() for k in (first, second)))
        encoded = EncodedPair(first, second, truth)
        if keep and len(self._kept) < _MOST_KEPT:
            self._kept.append(encoded)
        elif keep:
            self._kept[self._rng.integers(_MOST_KEPT)] = encoded
        return encoded

    def learn(self) -> None:
        """Add the gradients of the pairs of a step."""
        for _ in range(_PAIRS_PER_STEP):
            self._learn_from(self._draw())

    def _learn_from(self, pair: EncodedPair) -> None:
        """Add the gradient of one pair."""
        truth = pair.truth
        with bfloat16_where_quick():
            features = self._matcher.attend(pair.first, pair.second)
        found = self._matcher.assign(features.float(), pair.first.points.shape[1])
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

    def report(self, steps: int) -> None:
        """Print a line about the pairs since the last report."""
        loss, true, right, count = np.sum(self._figures, axis=0) if self._figures else (0, 1, 0, 1)
        self._figures.clear()
        told = f"loss {loss / count:.3f}, {right / max(true, 1):.1%} right"
        print(f"{_PAIRS_PER_STEP * steps} pairs: {told}", flush=True)

    def save(self, steps: int) -> None:
        """Write the checkpoint."""
        blocks = f"{self._settings.encoder_blocks} encoder blocks trained"
        what = f"{_PAIRS_PER_STEP * steps} wide-baseline pairs of rooms, {blocks}"
        training = self._settings.history(self._start.training, what)
        origin = "XFeat and LighterGlue as published, trained on by this project"
        states = state_of(self._encoder), state_of(self._matcher)
        Weights(*states, origin, training).save(self._settings.out)

    def _keypoints(self, image: Any) -> Keypoints:
        with torch.set_grad_enabled(self._settings.encoder_blocks > 0):
            found: Keypoints = self._encoder(torch.from_numpy(image)[None, None]).found()
        return found
