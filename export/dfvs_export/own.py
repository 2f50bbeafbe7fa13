"""dfvs-flow with its weights, as something that bundles are made of."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import torch

from dfvs_core.geometry.arrays import Float32Array
from dfvs_core.messages.manifest import Manifest
from dfvs_export.bundles import Source, encode_match_bundle
from dfvs_export.calibration import ImagePair
from dfvs_export.card import model_card
from dfvs_export.graphs import MatchGraph, to_onnx
from dfvs_export.running import BundleRunner
from dfvs_export.weights import Weights, load_weights
from dfvs_models.bundle import Bundle
from dfvs_models.evaluation import LevelScore

NAME = "dfvs-flow"
KEYPOINTS = 1280
"""Keypoints of an image."""
_SAME_KEYPOINTS = 0.99
"""Share of the keypoints that torch and ONNX Runtime find alike; scores that tie may swap."""
_MATCHED = 0.1
"""Confidence from which on a keypoint counts as matched."""


@dataclass(frozen=True, slots=True)
class OwnFlow:
    """dfvs-flow with trained weights; a ``MatchingNetwork``."""

    weights: Weights

    @classmethod
    def load(cls, path: Path | None) -> OwnFlow:
        """Read a checkpoint or the published wheel, or where none is named the shipped weights.

        Raises
        ------
        ModelError
            If it cannot be used.
        """
        return cls(load_weights(path))

    @property
    def origin(self) -> str:
        """Where the weights come from, and which they are, as manifests say it."""
        return f"{self.weights.origin}, weights {self.weights.digest}"

    def bundle(self, size: tuple[int, int]) -> Bundle:
        """Bundle in fp32 that works at ``size`` (width, height) px."""
        onnx = to_onnx(*self.weights.networks(size, KEYPOINTS), size)
        return encode_match_bundle(onnx, size, Source(NAME, self.origin, "Apache-2.0"))

    def differences_px(self, runner: BundleRunner, pair: ImagePair) -> Float32Array:
        """How far partners from ONNX Runtime are from torch's, or the keypoints if others."""
        picture = runner.bundle.manifest.input
        encoder, matcher = self.weights.networks((picture.width, picture.height), KEYPOINTS)
        with torch.no_grad():
            sides = [encoder(torch.from_numpy(runner.tensor(image))) for image in pair]
            expected, sure = (
                value.numpy()[0] for value in MatchGraph(matcher)(*sides[0], *sides[1])
            )
        tensors = [[value.numpy() for value in side] for side in sides]
        for image, (points, _, scores) in zip(pair, tensors, strict=True):
            apart = _apart_px(points[0][scores[0] > 0], runner.encode(image)[0][0])
            if np.count_nonzero(apart) > (1 - _SAME_KEYPOINTS) * len(apart):
                return apart
        partners, confidence = (value[0] for value in runner.match(*tensors))
        either = np.maximum(confidence, sure) > _MATCHED
        apart = np.linalg.norm(partners - expected, axis=1)[either]
        return np.append(apart, np.abs(confidence - sure).max()).astype(np.float32)

    def card(self, manifest: Manifest, scores: Mapping[str, LevelScore], pairs_name: str) -> str:
        """Text of the model card; ``scores`` may be empty."""
        return model_card(self.weights, manifest, scores, pairs_name)


def _apart_px(expected: Float32Array, found: Float32Array) -> Float32Array:
    """Distance (N,) of each point (N, 2) from the nearest of those found (M, 2)."""
    distances = np.linalg.norm(expected[:, None] - found, axis=2)
    return np.asarray(distances.min(axis=1), np.float32)
