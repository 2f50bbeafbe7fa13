"""What bundles are made of and checked against: a matching network in torch."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Protocol

from dfvs_core.geometry.arrays import Float32Array
from dfvs_core.messages.manifest import Manifest
from dfvs_export.calibration import ImagePair
from dfvs_export.running import BundleRunner
from dfvs_models.bundle import Bundle
from dfvs_models.evaluation import LevelScore


class MatchingNetwork(Protocol):
    """A matching network with its weights."""

    def bundle(self, size: tuple[int, int]) -> Bundle:
        """Bundle in fp32 for images of ``size`` (width, height) px."""

    def differences_px(self, runner: BundleRunner, pair: ImagePair) -> Float32Array:
        """How far what ONNX Runtime gives is from what torch gives, for each vector (N,)."""

    def card(self, manifest: Manifest, scores: Mapping[str, LevelScore], pairs_name: str) -> str:
        """Text of the model card; ``scores`` on the file ``pairs_name`` may be empty."""
