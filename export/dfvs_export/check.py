"""Checking a bundle: files and operators, torch against ONNX Runtime, accuracy."""

from __future__ import annotations

import io
from collections import Counter
from collections.abc import Iterable, Mapping
from dataclasses import dataclass

import numpy as np
import onnx
import torch
from numpy.typing import NDArray

from dfvs_core.errors import ModelError
from dfvs_core.matching.evaluation import LEVELS, LevelScore, PairScore, score_pair, summarise
from dfvs_core.matching.matcher import Matcher
from dfvs_core.servo.config import ServoConfig
from dfvs_export.calibration import ImagePair
from dfvs_export.data.pairs import PairSettings, make_pair
from dfvs_export.data.shards import TEXTURES_PER_SHARD
from dfvs_export.data.textures import make_texture_bank
from dfvs_export.network import FlowNetwork
from dfvs_export.running import FlowRunner
from dfvs_models.evaluation_file import FlowPairs

PARITY_LIMIT_PX = 1e-3
"""Greatest difference of flow in fp32 between torch and ONNX Runtime, where it is trusted."""
_TRUSTED = ServoConfig().min_confidence
"""Confidence from which on the servo uses a flow.

Elsewhere it is carried over from far away, and the last digit of a similarity moves it by up to a
thousandth of a pixel, within torch alone.
"""
MOST_ERROR_RATIO = 1.15
"""Mean error of a bundle of lower precision over that of the one it was made from."""


@dataclass(frozen=True, slots=True)
class Parity:
    """Differences of flow between torch and ONNX Runtime over some pairs, px.

    ``trusted_px`` is the greatest where the servo would use the flow, if it would anywhere; the
    others are of all pixels.
    """

    greatest_px: float
    trusted_px: float
    mean_px: float
    pairs: int

    @property
    def holds(self) -> bool:
        """Whether both give the same flow, but for rounding; not so where it is not a number."""
        return self.trusted_px <= PARITY_LIMIT_PX and bool(np.isfinite(self.greatest_px))


def drawn_pairs(size: tuple[int, int], count: int, seed: int) -> list[ImagePair]:
    """Draw pairs (H, W, 3) uint8 from the training generator, for calibration and parity."""
    g = torch.Generator().manual_seed(seed)
    bank = make_texture_bank(TEXTURES_PER_SHARD, g)
    drawn = [make_pair(bank, PairSettings(*size), g) for _ in range(count)]
    return [(_to_uint8(p.image_a), _to_uint8(p.image_b)) for p in drawn]


def _to_uint8(image: torch.Tensor) -> NDArray[np.uint8]:
    return np.asarray((image.clamp(0.0, 1.0) * 255.0).round().to(torch.uint8).numpy())


def operators(contents: dict[str, bytes]) -> Counter[str]:
    """Count the operators of all ONNX files.

    Raises
    ------
    ModelError
        If a file is not valid ONNX, or uses operators outside ONNX's own.
    """
    counts: Counter[str] = Counter()
    for name, data in contents.items():
        if not name.endswith(".onnx"):
            continue
        model = onnx.load_model(io.BytesIO(data))
        try:
            onnx.checker.check_model(model)
        except onnx.checker.ValidationError as error:
            raise ModelError(f"{name} is not valid ONNX: {error}") from error
        foreign = {node.domain for node in model.graph.node} - {"", "ai.onnx"}
        if foreign:
            raise ModelError(f"{name} uses operators of {sorted(foreign)}", "ONNX's own only")
        counts.update(node.op_type for node in model.graph.node)
    return counts


def parity(network: FlowNetwork, runner: FlowRunner, pairs: Iterable[ImagePair]) -> Parity:
    """Compare torch with ONNX Runtime on pairs, one or more, of the bundle's size."""
    greatest, trusted, means = [], [], []
    for first, second in pairs:
        field = runner.match(runner.encode(first), runner.encode(second))
        with torch.no_grad():
            tensors = [torch.from_numpy(runner.tensor(image)) for image in (first, second)]
            flow = network.flow(*tensors)[0].permute(1, 2, 0).numpy()
        difference = np.abs(flow - field.flow)
        greatest.append(float(difference.max()))
        used = difference[field.confidence >= _TRUSTED]
        if used.size:
            trusted.append(float(used.max()))
        means.append(float(difference.mean()))
    decisive = trusted or greatest  # where nothing is trusted, all of it has to agree
    return Parity(
        float(np.max(greatest)), float(np.max(decisive)), float(np.mean(means)), len(means)
    )


def error_ratios(
    scores: Mapping[str, LevelScore], reference: Mapping[str, LevelScore]
) -> dict[str, float]:
    """Mean error over that of a reference on the same pairs, one or more, by level of motion."""
    return {
        level: round(score.epe_px / reference[level].epe_px, 4) for level, score in scores.items()
    }


def accuracy(matcher: Matcher, pairs: FlowPairs) -> dict[str, LevelScore]:
    """Score a network on pairs with exact flow, by level of motion."""
    found: dict[str, list[PairScore]] = {}
    for first, second, flow, visible, level in pairs:
        field = matcher.match(matcher.prepare(first), matcher.prepare(second))
        found.setdefault(LEVELS[int(level)], []).append(score_pair(field, flow, visible))
    return {name: summarise(found[name]) for name in LEVELS if name in found}


def accuracy_figures(scores: dict[str, LevelScore]) -> dict[str, float]:
    """Return the figures that a manifest keeps.

    Raises
    ------
    ModelError
        If the bundle's flow was not finite.
    """
    figures = {}
    for level, score in scores.items():
        figures[f"{level}_epe_px"] = round(score.epe_px, 3)
        figures[f"{level}_under_3px"] = round(score.under_3px, 4)
        figures[f"{level}_sure_half_epe_px"] = round(score.sure_half_epe_px, 3)
    if not np.isfinite(list(figures.values())).all():
        raise ModelError("the bundle's flow is not finite", "finite flow on every pair")
    return figures
