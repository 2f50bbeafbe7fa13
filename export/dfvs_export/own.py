"""dfvs-flow from a checkpoint of its training, as something that bundles are made of."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path

from torch import Tensor

from dfvs_core.errors import ConfigError
from dfvs_core.manifest import Manifest
from dfvs_core.matching.evaluation import LevelScore
from dfvs_export.bundles import Source, encode_match_bundle
from dfvs_export.card import model_card
from dfvs_export.graphs import to_onnx
from dfvs_export.networks.dfvs_flow import DfvsFlow
from dfvs_export.train.checkpoint import Checkpoint, load_checkpoint, load_network
from dfvs_models.bundle import Bundle

NAME = "dfvs-flow"


@dataclass(frozen=True, slots=True)
class OwnFlow:
    """dfvs-flow with trained weights; a ``FlowNetwork``."""

    network: DfvsFlow
    checkpoint: Checkpoint

    @classmethod
    def load(cls, path: Path | None) -> OwnFlow:
        """Read a checkpoint.

        Raises
        ------
        ConfigError, ModelError
            If none is named, or it cannot be used.
        """
        if path is None:
            raise ConfigError("no checkpoint given", "--checkpoint FILE.pt of a training run")
        return cls(load_network(path), load_checkpoint(path))

    def bundle(self, size: tuple[int, int]) -> Bundle:
        """Bundle in fp32 for pictures of ``size`` (width, height) px."""
        origin = (
            f"trained by this project from scratch on drawn rooms, {self.checkpoint.step} steps"
        )
        return encode_match_bundle(
            to_onnx(self.network, size), size, Source(NAME, origin, "Apache-2.0")
        )

    def flow(self, first: Tensor, second: Tensor) -> Tensor:
        """Flow (1, 2, H, W) px from torch, of pictures as the bundle takes them."""
        features = [self.network.encode(image) for image in (first, second)]
        return self.network.match(features[0], features[1]).flow

    def card(self, manifest: Manifest, scores: Mapping[str, LevelScore], pairs_name: str) -> str:
        """Text of the model card; ``scores`` may be empty."""
        size = (manifest.input.width, manifest.input.height)
        return model_card(self.checkpoint, size, manifest.precision, scores, pairs_name)
