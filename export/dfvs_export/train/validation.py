"""Measuring a network on pairs with exact flow, by size of the motion."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

import numpy as np
import torch
from torch.nn import functional

from dfvs_core.errors import ConfigError
from dfvs_core.matching.evaluation import LEVELS
from dfvs_export.networks.dfvs_flow import DfvsFlow
from dfvs_models.evaluation_file import FlowPairs, read_flow_pairs


@dataclass(frozen=True, slots=True)
class LevelScores:
    """Mean over the pairs of one level.

    Parameters
    ----------
    level : str
        ``"small"``, ``"medium"`` or ``"large"`` motion.
    epe_px : float
        End-point error over the pixels seen in both, px.
    under_3px : float
        Share of those pixels with an error under 3 px.
    sure_half_epe_px : float
        The error of the half that the network is surest of, px.
    pairs : int
        Number of pairs.
    """

    level: str
    epe_px: float
    under_3px: float
    sure_half_epe_px: float
    pairs: int

    def line(self) -> str:
        """One short text."""
        return f"{self.level} {self.epe_px:.2f} px {100 * self.under_3px:.0f} %"


def read_validation(path: Path) -> FlowPairs:
    """Pairs to watch a training on.

    Raises
    ------
    ConfigError, ImageError
        If they cannot be read, or the network does not take their size.
    """
    pairs = read_flow_pairs(path)
    height, width = pairs.current.shape[1:3]
    if height % 16 or width % 16:
        raise ConfigError(f"{path} holds pictures of {width}x{height} px", "multiples of 16")
    return pairs


def score_network(network: DfvsFlow, pairs: FlowPairs) -> tuple[LevelScores, ...]:
    """Measure a network in evaluation mode on pairs with exact flow."""
    device = next(network.parameters()).device
    found: dict[int, list[tuple[float, float, float]]] = {}
    for image_a, image_b, flow, seen, level in pairs:
        stack = torch.from_numpy(np.stack([image_a, image_b])).to(device)
        images = stack.permute(0, 3, 1, 2).float() / 255.0
        with torch.no_grad():
            match = network.match(network.encode(images[:1]), network.encode(images[1:]))
        sure = functional.interpolate(match.confidence(), scale_factor=4.0, mode="bilinear")[0, 0]
        estimate = match.flow[0].permute(1, 2, 0).cpu().numpy()
        error = np.linalg.norm(estimate - flow, axis=2)[seen]
        best = np.argsort(-sure.cpu().numpy()[seen])[: max(1, len(error) // 2)]
        row = (float(error.mean()), float((error < 3.0).mean()), float(error[best].mean()))
        found.setdefault(int(level), []).append(row)
    scores = []
    for k, rows in sorted(found.items()):
        epe, under, sure_epe = np.mean(rows, axis=0).tolist()
        scores.append(LevelScores(LEVELS[k], epe, under, sure_epe, len(rows)))
    return tuple(scores)
