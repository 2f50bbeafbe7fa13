"""What bundles are made of and checked against: a flow network in torch."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Protocol

from torch import Tensor

from dfvs_core.manifest import Manifest
from dfvs_core.matching.evaluation import LevelScore
from dfvs_models.bundle import Bundle


class FlowNetwork(Protocol):
    """A flow network with its weights."""

    def bundle(self, size: tuple[int, int]) -> Bundle:
        """Bundle in fp32 for pictures of ``size`` (width, height) px."""

    def flow(self, first: Tensor, second: Tensor) -> Tensor:
        """Flow (1, 2, H, W) px from torch, of pictures (1, 3, H, W) as the bundle takes them."""

    def card(self, manifest: Manifest, scores: Mapping[str, LevelScore], pairs_name: str) -> str:
        """Text of the model card; ``scores`` on the file ``pairs_name`` may be empty."""
