"""The two graphs of dfvs-flow as ONNX files of fixed size."""

from __future__ import annotations

import io
import warnings

import torch
from torch import Tensor, nn
from torch.nn import functional

from dfvs_export.networks.dfvs_flow import DfvsFlow
from dfvs_export.networks.encoder import Features
from dfvs_export.onnx_pair import (
    ENCODE_INPUTS,
    ENCODE_OUTPUTS,
    MATCH_INPUTS,
    MATCH_OUTPUTS,
    OnnxPair,
)

OPSET = 17


class EncodeGraph(nn.Module):
    """Image (1, 3, H, W) in [0, 1] to ``Features``."""

    def __init__(self, network: DfvsFlow) -> None:
        super().__init__()
        self.network = network

    def forward(self, image: Tensor) -> tuple[Tensor, ...]:
        """Features as a tuple, which is what ONNX knows."""
        features = self.network.encode(image)
        return features.at16, features.at8, features.at4, features.image


class MatchGraph(nn.Module):
    """Two sets of features to flow (1, 2, H, W) px and confidence (1, 1, H, W)."""

    def __init__(self, network: DfvsFlow) -> None:
        super().__init__()
        self.network = network

    def forward(self, *features: Tensor) -> tuple[Tensor, Tensor]:
        """Flow and confidence from the features of the first image, then of the second."""
        at16, at8, at4 = features[:3]
        second = Features(*features[3:])
        first = Features(at16, at8, at4, second.image)  # the first image is not looked at
        match = self.network.match(first, second)
        full = functional.interpolate(match.confidence(), scale_factor=4.0, mode="bilinear")
        return match.flow, full


def to_onnx(network: DfvsFlow, size: tuple[int, int]) -> OnnxPair:
    """Trace both graphs at a fixed size (width, height) px."""
    width, height = size
    network = network.eval()
    image = torch.rand(1, 3, height, width, generator=torch.Generator().manual_seed(0))
    encode, match = EncodeGraph(network).eval(), MatchGraph(network).eval()
    with torch.no_grad():
        features = encode(image)
    return OnnxPair(
        trace(encode, (image,), (ENCODE_INPUTS, ENCODE_OUTPUTS)),
        trace(match, (*features[:3], *features), (MATCH_INPUTS, MATCH_OUTPUTS)),
    )


def trace(
    graph: nn.Module,
    inputs: tuple[Tensor, ...],
    names: tuple[tuple[str, ...], tuple[str, ...]],
) -> bytes:
    """Trace a graph with these inputs; ``names`` are those of its inputs and outputs."""
    file = io.BytesIO()
    with warnings.catch_warnings(), torch.no_grad():
        # the tracing exporter is the one whose files were measured to be small and fast here
        warnings.simplefilter("ignore")
        torch.onnx.export(
            graph,
            inputs,
            file,  # type: ignore[arg-type]  # the tracing exporter writes to files of any kind
            input_names=list(names[0]),
            output_names=list(names[1]),
            opset_version=OPSET,
            dynamo=False,
        )
    return file.getvalue()
