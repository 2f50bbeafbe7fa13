"""dfvs-flow with its weights, as something that bundles are made of."""

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np
import torch
from torch import Tensor, nn

from dfvs_core.geometry.arrays import Float32Array
from dfvs_core.messages.manifest import Manifest
from dfvs_core.messages.network_tensors import ImageInput
from dfvs_export.bundles.bundle import Source, make_bundle
from dfvs_export.bundles.card import flow_accuracy, model_card
from dfvs_export.bundles.runner import BundleRunner, ImagePair
from dfvs_export.bundles.tracing import TensorNames, round_weights, trace
from dfvs_export.networks.lighterglue import LighterGlue
from dfvs_export.networks.xfeat import Keypoints
from dfvs_export.weights.flow import Weights
from dfvs_models.bundle import Bundle
from dfvs_models.evaluation import LevelScore

NAME = "dfvs-flow"
KEYPOINTS = 1280
"""Keypoints of an image."""
_SAME_KEYPOINTS = 0.99
"""Share of the keypoints that torch and ONNX Runtime find alike; scores that tie may swap."""
_ENCODE: TensorNames = (("image",), ("points", "descriptors", "scores"))
_MATCH: TensorNames = (
    tuple(f"{side}_{name}" for side in ("first", "second") for name in Keypoints._fields),
    ("partners", "confidence"),
)
_ANY_SIZE = {
    name: {1: "second" if name.startswith("second") else "first"} for name in sum(_MATCH, ())
}
"""Keypoints are as many as each match asks for."""
_MATCHED = 0.1
"""Confidence from which on a keypoint counts as matched."""
_ABOUT = """\
Sparse matches of a camera's image with a goal image, for visual servoing. Two graphs: `encode`
(keypoints with descriptors, once per image) and `match` (the partner of each, with a confidence).

- Encoder: XFeat (Potje et al., CVPR 2024). Matcher: LighterGlue, a LightGlue of width 96
  (Lindenberger et al., ICCV 2023).
- Input: {m.input.width} x {m.input.height} px, grey, 0 to 255; a negative pixel is outside \
of the image.
  Precision: {m.precision}.
- {parameters:.2f} million parameters. Origin: {m.origin}.
- Licence: Apache-2.0, as the published weights that it starts from."""
_LIMITS = """\
- Roll of more than about 25 degrees; the service turns the goal image for that.
- Repeated structures: any of several like windows or balusters may be matched.
- Moving things: the scene is taken to be still."""


class MatchGraph(nn.Module):
    """Keypoints of two images to partners (B, N, 2) px of the first's, and confidence (B, N).

    Those of an image are points and descriptors. The confidence is 0 where two points are not
    each other's likeliest partner.
    """

    def __init__(self, matcher: LighterGlue) -> None:
        super().__init__()
        self.matcher = matcher

    def forward(self, *tensors: Tensor) -> tuple[Tensor, Tensor]:
        """Partners and confidence."""
        first, second = Keypoints(*tensors[:2]), Keypoints(*tensors[2:])
        log = self.matcher(first, second).log_probability
        best, partner = log.max(dim=2)
        back = log.argmax(dim=1).gather(1, partner)
        own = torch.arange(log.shape[1], device=log.device)[None]
        mutual = (back == own).to(log.dtype)
        points = second.points.gather(1, partner[..., None].expand(-1, -1, 2))
        return points, best.exp() * mutual


@dataclass(frozen=True, slots=True)
class OwnFlow:
    """dfvs-flow with trained weights."""

    weights: Weights

    @property
    def origin(self) -> str:
        """Where the weights come from, and which they are, as manifests say it."""
        return f"{self.weights.origin}, weights {self.weights.digest}"

    def bundle(self, size: tuple[int, int]) -> Bundle:
        """Bundle in fp32 that works at ``size`` (width, height) px."""
        encoder, matcher = self.weights.networks(size, KEYPOINTS)
        width, height = size
        image = 255 * torch.rand(1, 1, height, width, generator=torch.Generator().manual_seed(0))
        with torch.no_grad():
            keypoints = encoder(image).found()
        encode = trace(encoder, (image,), _ENCODE)
        match = trace(MatchGraph(matcher).eval(), (*keypoints, *keypoints), _MATCH, _ANY_SIZE)
        graphs = {
            "encode": (round_weights(encode), _ENCODE),
            "match": (round_weights(match), _MATCH),
        }
        images = ImageInput(*size, multiple_of=32, channels="grey", scale=1.0)
        return make_bundle("encode-match", graphs, images, Source(NAME, self.origin, "Apache-2.0"))

    def differences(self, runner: BundleRunner, pair: ImagePair) -> Float32Array:
        """How far partners from ONNX Runtime are from torch's, px, or the keypoints if others."""
        taken = runner.bundle.manifest.input
        encoder, matcher = self.weights.networks((taken.width, taken.height), KEYPOINTS)
        with torch.no_grad():
            sides = [encoder(torch.from_numpy(runner.tensor(image))).found() for image in pair]
            expected, expected_confidence = (
                value.numpy()[0] for value in MatchGraph(matcher)(*sides[0], *sides[1])
            )
        for image, side in zip(pair, sides, strict=True):
            apart = _apart_px(side.points[0].numpy(), runner.encode(image)[0][0])
            if np.count_nonzero(apart) > (1 - _SAME_KEYPOINTS) * len(apart):
                return apart
        partners, confidence = (
            value[0] for value in runner.match(*([v.numpy() for v in side] for side in sides))
        )
        either = np.maximum(confidence, expected_confidence) > _MATCHED
        apart = np.linalg.norm(partners - expected, axis=1)[either]
        return np.append(apart, np.abs(confidence - expected_confidence).max()).astype(np.float32)

    def card(self, manifest: Manifest, scores: Mapping[str, LevelScore], pairs_name: str) -> str:
        """Text of the model card; ``scores`` may be empty."""
        states = (*self.weights.encoder.items(), *self.weights.matcher.items())
        about = _ABOUT.format(m=manifest, parameters=sum(v.numel() for _, v in states) / 1e6)
        accuracy = flow_accuracy(scores, pairs_name)
        return model_card(NAME, about, accuracy, self.weights.training, _LIMITS)


def _apart_px(expected: Float32Array, found: Float32Array) -> Float32Array:
    """Distance (N,) of each point (N, 2) from the nearest of those found (M, 2)."""
    distances = np.linalg.norm(expected[:, None] - found, axis=2)
    return np.asarray(distances.min(axis=1), np.float32)
