"""What bundles are made of and checked against: networks in torch."""

from collections.abc import Mapping
from typing import Protocol

from dfvs_core.geometry.arrays import Float32Array
from dfvs_core.messages.manifest import Manifest
from dfvs_export.bundles.runner import BundleRunner, ImagePair
from dfvs_models.bundle import Bundle
from dfvs_models.evaluation import LevelScore


class TorchNetwork(Protocol):
    """A network in torch with its weights."""

    def differences(self, runner: BundleRunner, pair: ImagePair) -> Float32Array:
        """How far what ONNX Runtime gives of a pair is from what torch gives (N,)."""


class MatchingNetwork(TorchNetwork, Protocol):
    """A matching network; its differences are of every vector, px."""

    def bundle(self, size: tuple[int, int]) -> Bundle:
        """Bundle in fp32 for images of ``size`` (width, height) px."""

    def card(self, manifest: Manifest, scores: Mapping[str, LevelScore], pairs_name: str) -> str:
        """Text of the model card; ``scores`` on the file ``pairs_name`` may be empty."""
