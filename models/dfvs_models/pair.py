"""Matcher from a published flow network (``pair`` bundle)."""

from collections.abc import Iterator, Sequence
from typing import cast

import cv2
import numpy as np

from dfvs_core.errors import ModelError
from dfvs_core.geometry.arrays import Float32Array, ImageArray
from dfvs_core.matching.config import MatchingConfig
from dfvs_core.matching.correspondence import FlowField, empty_flow, exclude
from dfvs_core.matching.dense_search import (
    forward_backward_consistency,
    normalised_cross_correlation,
)
from dfvs_core.matching.matcher import ImageFeatures, check_pair, working_size
from dfvs_core.matching.points import NO_MATCHES, Exclusion, PointMatches
from dfvs_core.matching.smooth_flow import confident_matches
from dfvs_core.matching.warping import lands_inside, pixel_grid, sample
from dfvs_core.messages.network_tensors import FlowOutput, ImageInput
from dfvs_models.bundle import Bundle
from dfvs_models.onnx_session import Execution, OnnxGraph, trial_image


class PairImage(ImageFeatures):
    """An image as the network wants it, (1, C, h, w) float32, and in grey (H, W)."""

    def __init__(self, image: ImageArray, spec: ImageInput) -> None:
        super().__init__(working_size(image))
        self.grey = cast(ImageArray, cv2.cvtColor(image, cv2.COLOR_RGB2GRAY))
        self.tensor = image_tensor(image, spec)


class PairMatcher:
    """Runs a ``pair`` network both ways for every match.

    Flow there and back shows what is visible in both images, which a network that gives flow
    alone does not; it doubles the time of a match. A prediction is not used.

    Raises
    ------
    ModelError
        If the graph's tensors are not what the manifest says, or its output is not finite.
    """

    def __init__(self, bundle: Bundle, execution: Execution) -> None:
        manifest = bundle.manifest
        if manifest.flow is None:
            raise ModelError(f"bundle {manifest.name!r} gives no flow", "a bundle of kind 'pair'")
        self._input = manifest.input
        self._flow = manifest.flow
        self.width_px = manifest.input.width
        """Of the network's images."""
        self._config = MatchingConfig()
        self._graph = OnnxGraph(bundle, "pair", execution)
        self._graph.require_shapes(self._input.pair_shapes())
        self._try_out()

    def encode(self, image: ImageArray) -> PairImage:
        """Resize and normalise an image (H, W, 3) uint8 RGB."""
        return PairImage(image, self._input)

    def match(
        self, current: ImageFeatures, other: ImageFeatures, *, excluded: Sequence[FlowField] = ()
    ) -> FlowField:
        """Flow from ``current`` to ``other``; see ``dfvs_core.matching.matcher.Matcher``.

        Output that is not finite gives a field of zeros without confidence. A network finds what it
        finds: if that is to be passed over there is nothing.
        """
        first, second = check_pair(current, other, PairImage)
        there, back = self._run(first, second), self._run(second, first)
        if not (np.isfinite(there).all() and np.isfinite(back).all()):
            return empty_flow(first.size)
        brought = sample(second.grey, pixel_grid(first.size) + there)
        confidence = forward_backward_consistency(there, back, self._config)
        confidence *= np.maximum(normalised_cross_correlation(first.grey, brought), 0.0)
        field = FlowField(there, confidence * lands_inside(there))
        return exclude(field, excluded, self._config)

    def track(
        self, current: ImageFeatures, other: ImageFeatures, predicted: FlowField
    ) -> FlowField | None:
        """Flow of the network, which takes as long with a prediction as without."""
        return self.match(current, other)

    def extend(
        self, current: ImageFeatures, other: ImageFeatures, known: FlowField
    ) -> FlowField | None:
        """Nothing: the network's flow is all that it finds."""
        return None

    def _run(self, current: PairImage, other: PairImage) -> Float32Array:
        """Flow (H, W, 2) px of the images' own size."""
        (raw,) = self._graph.run(pair_tensors(current.tensor, other.tensor, self._input))
        return image_flow(raw, self._input, self._flow, current.size)

    def _try_out(self) -> None:
        """Run the network once: shapes that lie and weights that are not finite show up."""
        self._graph.require_outputs()
        width, height, stride = self._input.width, self._input.height, self._flow.stride
        pixels = np.repeat(trial_image(width, height)[..., None], 3, axis=2)
        tensor = image_tensor(pixels, self._input)
        outputs = self._graph.run(pair_tensors(tensor, tensor, self._input))
        self._graph.require_values(
            outputs, [(1, 2, height // stride, width // stride)], "finite flow"
        )


class FlowPoints:
    """The confident flow of a network as sparse matches; one hypothesis."""

    def __init__(self, network: PairMatcher) -> None:
        self._network = network
        self.width_px, self.encode = network.width_px, network.encode

    def hypotheses(
        self, current: PairImage, other: PairImage, exclusion: Exclusion | None = None
    ) -> Iterator[PointMatches]:
        """See ``dfvs_core.matching.points``."""
        yield confident_matches(self._network.match(current, other))

    def expected(
        self, current: PairImage, other: PairImage, turn_rad: float, scale: float
    ) -> PointMatches:
        """No matches: these networks take too long between frames."""
        return NO_MATCHES


def image_tensor(image: ImageArray, spec: ImageInput) -> Float32Array:
    """Tensor (1, C, h, w) of an image (H, W, 3) uint8 RGB, as the manifest asks."""
    shrinks = image.shape[1] > spec.width
    resized = cv2.resize(
        image,
        (spec.width, spec.height),
        interpolation=cv2.INTER_AREA if shrinks else cv2.INTER_LINEAR,
    )
    if spec.channels == "grey":
        values = cv2.cvtColor(resized, cv2.COLOR_RGB2GRAY)[..., None]
    else:
        values = resized[..., ::-1] if spec.channels == "bgr" else resized
    scaled = values.astype(np.float32) * np.float32(spec.scale)
    normalised = (scaled - np.array(spec.mean, np.float32)) / np.array(spec.std, np.float32)
    return np.ascontiguousarray(normalised.transpose(2, 0, 1)[None])


def pair_tensors(
    current: Float32Array, other: Float32Array, spec: ImageInput
) -> tuple[Float32Array, ...]:
    """Inputs of the graph from the tensors (1, C, h, w) of two images."""
    if spec.layout == "separate":
        return current, other
    if spec.layout == "channels":
        return (np.concatenate([current, other], axis=1),)
    return (np.stack([current, other], axis=1),)


def image_flow(
    raw: Float32Array, spec: ImageInput, meaning: FlowOutput, size: tuple[int, int]
) -> Float32Array:
    """Flow (H, W, 2) px of images of ``size`` (H, W) from the network's (1, 2, h, w)."""
    height, width = size
    channels = raw[0, ::-1] if meaning.order == "vu" else raw[0]
    flow = np.ascontiguousarray(channels.transpose(1, 2, 0)) * np.float32(meaning.scale)
    full = cv2.resize(flow, (width, height), interpolation=cv2.INTER_LINEAR)
    to_gray_image = np.array([width / spec.width, height / spec.height], np.float32)
    return np.asarray(full * to_gray_image, np.float32)
