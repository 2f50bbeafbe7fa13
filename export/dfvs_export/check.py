"""Checking a bundle: files and operators, torch against ONNX Runtime, accuracy."""

from __future__ import annotations

import io
from collections import Counter
from collections.abc import Iterable, Mapping
from dataclasses import dataclass

import cv2
import numpy as np
import onnx

from dfvs_core.errors import ModelError
from dfvs_core.matching.matcher import Matcher
from dfvs_core.matching.warping import flow_at_size
from dfvs_export.calibration import ImagePair
from dfvs_export.network import MatchingNetwork
from dfvs_export.running import BundleRunner
from dfvs_models.evaluation import LEVELS, LevelScore, PairScore, score_pair, summarise
from dfvs_models.evaluation_file import FlowPairs

PARITY_LIMIT_PX = 1e-3
"""Greatest difference in fp32 between torch and ONNX Runtime."""
MOST_ERROR_RATIO = 1.15
"""Mean error of a bundle of lower precision over that of the one it was made from."""
_BLOBS = 400
_LARGEST_BLOB = 0.15
"""Of the image's width."""


@dataclass(frozen=True, slots=True)
class Parity:
    """Differences between torch and ONNX Runtime over some pairs, px."""

    greatest_px: float
    mean_px: float
    pairs: int

    @property
    def holds(self) -> bool:
        """Whether both give the same, but for rounding; not so where it is not a number."""
        return self.greatest_px <= PARITY_LIMIT_PX


def drawn_pairs(size: tuple[int, int], count: int, seed: int) -> list[ImagePair]:
    """Draw images of random patches, and the same turned and scaled, for calibration and parity.

    Parameters
    ----------
    size : tuple of int
        (width, height) px of the images (H, W, 3) uint8.
    """
    rng = np.random.default_rng(seed)
    return [_drawn_pair(size, rng) for _ in range(count)]


def _drawn_pair(size: tuple[int, int], rng: np.random.Generator) -> ImagePair:
    width, height = size
    image = np.full((height, width, 3), 128, np.uint8)
    for _ in range(_BLOBS):
        middle = rng.uniform(0, size)
        sides = rng.uniform(0.01, _LARGEST_BLOB, 2) * width
        corners = cv2.boxPoints((tuple(middle), tuple(sides), rng.uniform(0, 180)))
        colour = tuple(int(c) for c in rng.integers(0, 256, 3))
        cv2.fillConvexPoly(image, corners.astype(np.int32), colour)
    turn = cv2.getRotationMatrix2D(
        (width / 2, height / 2), rng.uniform(-20, 20), rng.uniform(0.8, 1.25)
    )
    moved = cv2.warpAffine(image, turn, size, borderMode=cv2.BORDER_REFLECT)
    return image, np.asarray(moved, np.uint8)


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


def parity(network: MatchingNetwork, runner: BundleRunner, pairs: Iterable[ImagePair]) -> Parity:
    """Compare torch with ONNX Runtime on pairs, one or more."""
    found = [network.differences_px(runner, pair) for pair in pairs]
    everything = np.concatenate(found)
    return Parity(float(everything.max()), float(everything.mean()), len(found))


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
        found_flow = matcher.match(matcher.encode(first), matcher.encode(second))
        field = flow_at_size(found_flow, (first.shape[0], first.shape[1]))
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
        figures[f"{level}_sure_half_epe_px"] = round(score.confident_half_epe_px, 3)
    if not np.isfinite(list(figures.values())).all():
        raise ModelError("the bundle's flow is not finite", "finite flow on every pair")
    return figures
