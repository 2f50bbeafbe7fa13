"""The two graphs of dfvs-flow as ONNX files of fixed size."""

from __future__ import annotations

import io
import warnings
from dataclasses import dataclass

import torch
from torch import Tensor, nn

from dfvs_export.networks.lighterglue import LighterGlue
from dfvs_export.networks.xfeat import Keypoints, XFeat

OPSET = 17
ENCODE_INPUTS, ENCODE_OUTPUTS = ("image",), ("points", "descriptors", "scores")
MATCH_INPUTS = tuple(f"{side}_{name}" for side in ("first", "second") for name in ENCODE_OUTPUTS)
MATCH_OUTPUTS = ("partners", "confidence")
_ANY_COUNT = {
    name: {1: "second" if name.startswith("second") else "first"}
    for name in (*MATCH_INPUTS, *MATCH_OUTPUTS)
}
"""The count of keypoints is chosen from match to match."""


@dataclass(frozen=True, slots=True)
class OnnxPair:
    """Bytes of the two ONNX files."""

    encode: bytes
    match: bytes


class MatchGraph(nn.Module):
    """Keypoints of two images to partners (1, N, 2) px of the first's, and confidence (1, N).

    The confidence is 0 where two points are not each other's likeliest partner.
    """

    def __init__(self, matcher: LighterGlue) -> None:
        super().__init__()
        self.matcher = matcher

    def forward(self, *tensors: Tensor) -> tuple[Tensor, Tensor]:
        """Partners and confidence."""
        first, second = Keypoints(*tensors[:3]), Keypoints(*tensors[3:])
        log = self.matcher(first, second).log_probability
        best, partner = log.max(dim=2)
        back = log.argmax(dim=1).gather(1, partner)
        own = torch.arange(log.shape[1], device=log.device)[None]
        mutual = (back == own).to(log.dtype) * (first.scores > 0).to(log.dtype)
        points = second.points.gather(1, partner[..., None].expand(-1, -1, 2))
        return points, best.exp() * mutual


def to_onnx(encoder: XFeat, matcher: LighterGlue, size: tuple[int, int]) -> OnnxPair:
    """Trace both graphs for images of ``size`` (width, height) px."""
    width, height = size
    image = 255 * torch.rand(1, 1, height, width, generator=torch.Generator().manual_seed(0))
    with torch.no_grad():
        keypoints = encoder.eval()(image)
    match = MatchGraph(matcher).eval()
    return OnnxPair(
        trace(encoder, (image,), (ENCODE_INPUTS, ENCODE_OUTPUTS)),
        trace(match, (*keypoints, *keypoints), (MATCH_INPUTS, MATCH_OUTPUTS), _ANY_COUNT),
    )


def trace(
    graph: nn.Module,
    inputs: tuple[Tensor, ...],
    names: tuple[tuple[str, ...], tuple[str, ...]],
    free_axes: dict[str, dict[int, str]] | None = None,
) -> bytes:
    """Trace a graph with these inputs; ``names`` are those of its inputs and outputs.

    ``free_axes`` names the axes, by tensor, whose size is not fixed.
    """
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
            dynamic_axes=free_axes,
            dynamo=False,
        )
    return file.getvalue()
