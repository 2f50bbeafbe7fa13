"""Published flow networks from ptlflow as ``pair`` bundles."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np
import torch
from torch import Tensor, nn

from dfvs_core.geometry.arrays import Float32Array
from dfvs_core.messages.manifest import Manifest
from dfvs_core.messages.network_tensors import FlowOutput, ImageInput
from dfvs_export.bundles.bundle import Source, make_bundle
from dfvs_export.bundles.card import flow_accuracy, model_card
from dfvs_export.bundles.runner import BundleRunner, ImagePair
from dfvs_export.bundles.tracing import TensorNames, trace_published
from dfvs_export.weights.published import load_foreign
from dfvs_models.bundle import Bundle
from dfvs_models.evaluation import LevelScore

PREFIX = "ptlflow:"
_MULTIPLE = 16
_TENSORS: TensorNames = (("first", "second"), ("flow",))
_ABOUT = """\
A published network, converted through ptlflow: {origin}.

- Input: {m.input.width} x {m.input.height} px, BGR, 0 to 1. Precision: {m.precision}.
- Its licence, and that of its weights, is its authors': look there before you use it."""


class PairGraph(nn.Module):
    """Two images (1, 3, H, W), BGR from 0 to 1, to flow (1, 2, H, W) px."""

    def __init__(self, network: nn.Module) -> None:
        super().__init__()
        self.network = network

    def forward(self, first: Tensor, second: Tensor) -> Tensor:
        """Stack the images as ptlflow wants them and take its flow."""
        flows: Tensor = self.network({"images": torch.stack([first, second], dim=1)})["flows"]
        return flows[:, 0]


@dataclass(frozen=True, slots=True)
class PublishedFlow:
    """A network of ptlflow."""

    name: str
    graph: PairGraph
    source: str | None = None

    @classmethod
    def load(cls, name: str, source: str | None = None, digest: str | None = None) -> PublishedFlow:
        """Build the network and load its weights; see ``load_foreign``."""
        return cls(name, PairGraph(load_foreign(name, source, digest)).eval(), source)

    @property
    def origin(self) -> str:
        """Where the weights come from, in words."""
        if self.source is None:
            return "RANDOM weights, only to try out"
        return f"weights {self.source}"

    def bundle(self, size: tuple[int, int]) -> Bundle:
        """Bundle in fp32 for images of ``size`` (width, height) px.

        Raises
        ------
        ModelError
            If torch cannot trace the network.
        """
        width, height = size
        g = torch.Generator().manual_seed(0)
        example = tuple(torch.rand(1, 3, height, width, generator=g) for _ in _TENSORS[0])
        onnx = trace_published(self.name, self.graph, example, _TENSORS)
        source = Source(self.name, f"ptlflow {self.name}, {self.origin}", "see its authors")
        images = ImageInput(width, height, _MULTIPLE, channels="bgr")
        return make_bundle("pair", {"pair": (onnx, _TENSORS)}, images, source, flow=FlowOutput())

    def differences(self, runner: BundleRunner, pair: ImagePair) -> Float32Array:
        """How far the flow of ONNX Runtime is from torch's, px, at every pixel."""
        sides = [runner.encode(image) for image in pair]
        (flow,) = runner.match(*sides)
        with torch.no_grad():
            expected = self.graph(*(torch.from_numpy(side[0]) for side in sides)).numpy()
        return np.asarray(np.linalg.norm(flow - expected, axis=1).ravel(), np.float32)

    def card(self, manifest: Manifest, scores: Mapping[str, LevelScore], pairs_name: str) -> str:
        """Text of the model card; ``scores`` may be empty."""
        about = _ABOUT.format(m=manifest, origin=self.origin)
        return model_card(manifest.name, about, flow_accuracy(scores, pairs_name))
