"""dfvs-flow from a checkpoint of its training, as something that bundles are made of."""

from __future__ import annotations

import hashlib
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path

from torch import Tensor

from dfvs_core.manifest import Manifest
from dfvs_core.matching.evaluation import LevelScore
from dfvs_export.bundles import Source, encode_match_bundle
from dfvs_export.card import model_card
from dfvs_export.graphs import EncodeGraph, MatchGraph, to_onnx
from dfvs_export.networks.dfvs_flow import DfvsFlow
from dfvs_export.train.checkpoint import Checkpoint, load_checkpoint, load_network
from dfvs_export.working_size import Sizes, default_working_size
from dfvs_models.bundle import Bundle

NAME = "dfvs-flow"
SHIPPED = Path(__file__).parent / "assets" / f"{NAME}.pt"
"""The weights of the bundle that comes with ``dfvs_models``."""


@dataclass(frozen=True, slots=True)
class OwnFlow:
    """dfvs-flow with trained weights; a ``FlowNetwork``.

    ``working_size`` is what it works at inside a bundle; without one, see
    ``default_working_size``.
    """

    network: DfvsFlow
    checkpoint: Checkpoint
    working_size: tuple[int, int] | None = None

    @classmethod
    def load(cls, path: Path | None, working_size: tuple[int, int] | None = None) -> OwnFlow:
        """Read a checkpoint, or where none is named the shipped weights.

        Raises
        ------
        ModelError
            If it cannot be used.
        """
        path = path or SHIPPED
        return cls(load_network(path), load_checkpoint(path), working_size)

    @property
    def origin(self) -> str:
        """Where the weights come from, and which they are, as manifests say it."""
        digest = hashlib.sha256()
        for name, value in sorted(self.checkpoint.average.items()):
            digest.update(name.encode() + value.numpy().tobytes())
        return (
            f"trained by this project from scratch on drawn rooms, {self.checkpoint.step} steps,"
            f" weights {digest.hexdigest()[:12]}"
        )

    def bundle(self, size: tuple[int, int]) -> Bundle:
        """Bundle in fp32 for pictures of ``size`` (width, height) px.

        Raises
        ------
        ConfigError
            If the working size is larger.
        """
        sizes = self._sizes(size)
        source = Source(NAME, self.origin, "Apache-2.0")
        return encode_match_bundle(to_onnx(self.network, sizes), sizes, source)

    def flow(self, first: Tensor, second: Tensor) -> Tensor:
        """Flow (1, 2, H, W) px from torch, of pictures as the bundle takes them."""
        sizes = self._sizes((first.shape[3], first.shape[2]))
        encode = EncodeGraph(self.network, sizes)
        a, b = (encode(image) for image in (first, second))
        flow: Tensor = MatchGraph(self.network, sizes)(*a[:3], *b)[0]
        return flow

    def _sizes(self, size: tuple[int, int]) -> Sizes:
        return Sizes(size, self.working_size or default_working_size(size))

    def card(self, manifest: Manifest, scores: Mapping[str, LevelScore], pairs_name: str) -> str:
        """Text of the model card; ``scores`` may be empty."""
        return model_card(self.checkpoint, manifest, scores, pairs_name)
