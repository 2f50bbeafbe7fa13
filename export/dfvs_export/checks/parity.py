"""Comparison of a bundle in ONNX Runtime with its network in torch, on drawn images."""

from collections.abc import Iterable
from dataclasses import dataclass
from typing import Protocol

import cv2
import numpy as np

from dfvs_core.geometry.arrays import Float32Array
from dfvs_export.bundles.runner import BundleRunner, ImagePair

PARITY_LIMIT = 1e-3
"""Greatest difference in fp32 between torch and ONNX Runtime: px of flow, of the range of depth, m,
depths, rad or of a quaternion of a pose."""
_BLOBS = 400
_LARGEST_BLOB = 0.15
"""Of the image's width."""


class TorchNetwork(Protocol):
    """A network in torch with its weights."""

    def differences(self, runner: BundleRunner, pair: ImagePair) -> Float32Array:
        """How far what ONNX Runtime gives of a pair is from what torch gives (N,)."""


@dataclass(frozen=True, slots=True)
class Parity:
    """Differences between torch and ONNX Runtime over some pairs, in the network's unit."""

    greatest: float
    mean: float

    @property
    def holds(self) -> bool:
        """Whether both give the same, but for rounding; not so where it is not a number."""
        return self.greatest <= PARITY_LIMIT


def drawn_pairs(size: tuple[int, int], count: int, seed: int) -> list[ImagePair]:
    """Draw images (H, W, 3) uint8 of random patches, and the same turned and scaled.

    They are for calibration and parity; ``size`` is (width, height) px.
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


def parity(network: TorchNetwork, runner: BundleRunner, pairs: Iterable[ImagePair]) -> Parity:
    """Compare torch with ONNX Runtime on pairs, one or more."""
    everything = np.concatenate([network.differences(runner, pair) for pair in pairs])
    return Parity(float(everything.max()), float(everything.mean()))
