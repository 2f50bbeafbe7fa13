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
from dfvs_export.working_size import Shrink, Sizes, enlarged_flow

OPSET = 17


class EncodeGraph(nn.Module):
    """Image (1, 3, H, W) in [0, 1] to ``Features``, at the working size."""

    def __init__(self, network: DfvsFlow, sizes: Sizes) -> None:
        super().__init__()
        self.shrink = Shrink(sizes) if sizes.differ else nn.Identity()
        self.network = network

    def forward(self, image: Tensor) -> tuple[Tensor, ...]:
        """Features as a tuple, which is what ONNX knows."""
        features = self.network.encode(self.shrink(image))
        return features.at16, features.at8, features.at4, features.image


class MatchGraph(nn.Module):
    """Two sets of features to flow (1, 2, H, W) px and confidence (1, 1, H, W)."""

    def __init__(self, network: DfvsFlow, sizes: Sizes) -> None:
        super().__init__()
        self.network = network
        self.sizes = sizes

    def forward(self, *features: Tensor) -> tuple[Tensor, Tensor]:
        """Flow and confidence from the features of the first image, then of the second."""
        at16, at8, at4 = features[:3]
        second = Features(*features[3:])
        first = Features(at16, at8, at4, second.image)  # the first image is not looked at
        match = self.network.match(first, second)
        width, height = self.sizes.picture
        sure = functional.interpolate(match.confidence(), (height, width), mode="bilinear")
        flow = enlarged_flow(match.flow, self.sizes) if self.sizes.differ else match.flow
        return flow, sure


def to_onnx(network: DfvsFlow, sizes: Sizes) -> OnnxPair:
    """Trace both graphs at fixed sizes."""
    width, height = sizes.picture
    network = network.eval()
    image = torch.rand(1, 3, height, width, generator=torch.Generator().manual_seed(0))
    encode, match = EncodeGraph(network, sizes).eval(), MatchGraph(network, sizes).eval()
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
