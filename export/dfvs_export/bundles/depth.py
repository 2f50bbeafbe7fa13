"""Depth networks as ``mono`` bundles: ours and published ones."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace

import numpy as np
import torch
from torch import Tensor, nn

from dfvs_core.depth.network import DepthUnit
from dfvs_core.errors import ConfigError
from dfvs_core.geometry.arrays import Float32Array
from dfvs_core.messages.manifest import Manifest
from dfvs_core.messages.network_tensors import DepthOutput, ImageInput
from dfvs_core.messages.schema import dump, parse
from dfvs_export.bundles.bundle import Source, make_bundle
from dfvs_export.bundles.card import depth_accuracy, model_card
from dfvs_export.bundles.runner import FOCAL, BundleRunner, ImagePair
from dfvs_export.bundles.tracing import TensorNames, trace_published
from dfvs_export.networks.depth_anything import DepthAnything
from dfvs_export.weights.depth import load_depth_weights
from dfvs_export.weights.published_depth import ANYTHING, DENSE, LOADERS, MIDAS, DepthWeights
from dfvs_models.bundle import Bundle
from dfvs_models.depth_evaluation import MeasuredDepth

OWN = "dfvs-depth"
_SEED = 0
_LEAST_RANGE = 0.01
"""Range of an output over its size, below which differences are of rounding."""
_MEAN, _STD = (0.485, 0.456, 0.406), (0.229, 0.224, 0.225)
"""Of ImageNet's images."""
_ABOUT = """\
Depth of one image along the optical axis. Origin: {m.origin}.

- Input: {m.input.width} x {m.input.height} px, RGB{focal}. Precision: {m.precision}.
- Output: {quantity}, unit {m.depth.unit}, every {m.depth.stride} px, with {spread}.
- Licence: {m.licence}."""
_LIMITS = """\
- Rooms and light unlike those that it was trained on; views from close to a wall.
- The size of things: its scale is a guess from what rooms are like, which motion corrects.
- Mirrors, glass and the open sky."""
"""Of our own network: those of a published one are not known."""


@dataclass(frozen=True, slots=True)
class _Kind:
    """What is known of a network by its name: it gives inverse depth in ``unit``.

    ``size`` (width, height) px is the default, of multiples of ``multiple``.
    """

    size: tuple[int, int]
    multiple: int
    unit: DepthUnit
    stride: int
    licence: str
    is_normalised: bool = False
    estimates_spread: bool = False


_KINDS: Mapping[str, _Kind] = {
    OWN: _Kind((320, 240), 16, "1/m", 2, "Apache-2.0", estimates_spread=True),
    DENSE: _Kind((640, 480), 32, "1/m", 2, "see its authors"),
    ANYTHING: _Kind((322, 238), 14, "affine", 1, "see its authors", True),
    MIDAS: _Kind((256, 192), 32, "affine", 1, "see its authors", True),
}
MODELS = tuple(_KINDS)


@dataclass(frozen=True, slots=True)
class DepthModel:
    """A depth network in torch; the module takes what the graph ``mono`` takes.

    ``origin`` is one line; ``training`` a paragraph, empty where it is not ours.
    """

    name: str
    module: nn.Module
    origin: str
    training: str = ""

    @classmethod
    def load(cls, name: str, weights: DepthWeights) -> DepthModel:
        """Build a network and load its weights.

        Raises
        ------
        ConfigError, ModelError
            If a package that it needs is not installed, or the weights cannot be used.
        """
        if (weights.folder is not None) and name != ANYTHING:
            raise ConfigError(f"--from for {name}", "--checkpoint FILE")
        if weights.checkpoint is not None and name == ANYTHING:
            raise ConfigError(f"--checkpoint for {name}", "--from FOLDER")
        if weights.sha256 is not None and (name == OWN or weights.is_random):
            raise ConfigError(f"--sha256 for {name}", "it beside the file of published weights")
        torch.manual_seed(_SEED)
        if name == OWN:
            own = load_depth_weights(weights.checkpoint)
            origin = f"{own.origin}, trained on by this project, weights {own.digest}"
            return cls(name, own.network(), origin, own.training)
        return cls(name, LOADERS[name](weights).eval(), f"{name}, {weights.origin}")

    def bundle(
        self, size: tuple[int, int] | None, spread: float = 0.3, scale_spread: float = 0.2
    ) -> Bundle:
        """Bundle in fp32 for images of ``size`` (width, height) px, or of the network's own.

        The manifest states standard deviations of the logarithm of depth: ``spread`` of a network
        that does not estimate its own, ``scale_spread`` of a metric network's whole scale.

        Raises
        ------
        ConfigError
            If the network takes no images of this size, or a manifest no such spread.
        ModelError
            If torch cannot trace it.
        """
        kind = _KINDS[self.name]
        width, height = size or kind.size
        if width % kind.multiple or height % kind.multiple:
            raise ConfigError(f"size {width}x{height}", f"multiples of {kind.multiple}")
        if self.name == OWN and (width, height) != kind.size:
            raise ConfigError(f"size {width}x{height}", f"{kind.size[0]}x{kind.size[1]} for {OWN}")
        depth = parse(DepthOutput, dump(self._output(kind, spread, scale_spread)), "depth")
        names: TensorNames = (
            ("image", "focal")[: 2 if self.name == OWN else 1],
            ("depth", "spread")[: 2 if kind.estimates_spread else 1],
        )
        image = torch.rand(1, 3, height, width, generator=torch.Generator().manual_seed(_SEED))
        example = (image, torch.full((1, 1), FOCAL))[: len(names[0])]
        onnx = trace_published(self.name, self.module, example, names)
        images = ImageInput(width, height, kind.multiple)
        if kind.is_normalised:
            images = replace(images, mean=_MEAN, std=_STD)
        source = Source(self.name, self.origin, kind.licence)
        return make_bundle("mono", {"mono": (onnx, names)}, images, source, depth=depth)

    def _output(self, kind: _Kind, spread: float, scale_spread: float) -> DepthOutput:
        local = None if kind.estimates_spread else spread
        if isinstance(self.module, DepthAnything) and self.module.is_metric:
            return DepthOutput("depth", "m", kind.stride, local, scale_spread)
        scale = scale_spread if kind.unit == "1/m" else None
        return DepthOutput("inverse-depth", kind.unit, kind.stride, local, scale)

    def differences(self, runner: BundleRunner, pair: ImagePair) -> Float32Array:
        """How far ONNX Runtime's outputs are from torch's, over the range of torch's values."""
        apart = []
        for image in pair:
            tensors = runner.encode(image)
            found = runner.match(tensors, tensors)
            with torch.no_grad():
                outputs = self.module(*(torch.from_numpy(tensor) for tensor in tensors))
            expected = (outputs,) if isinstance(outputs, Tensor) else outputs
            for a, b in zip(found, (each.numpy() for each in expected), strict=True):
                extent = max(float(np.ptp(b)), _LEAST_RANGE * float(np.abs(b).max()))
                apart.append(np.abs(a - b).ravel() / extent)
        return np.concatenate(apart).astype(np.float32)

    def card(self, manifest: Manifest, measured: Mapping[str, MeasuredDepth]) -> str:
        """Text of the model card; ``measured`` by the file's label may be empty."""
        meaning = manifest.depth
        assert meaning is not None
        takes_focal = len(manifest.graphs["mono"].inputs) > 1
        stated = f"a standard deviation of its logarithm of {meaning.spread} (assumed)"
        about = _ABOUT.format(
            m=manifest,
            focal=" and the focal length over the width" if takes_focal else "",
            quantity=meaning.quantity.replace("-", " "),
            spread="the standard deviation of its logarithm" if meaning.spread is None else stated,
        )
        limits = _LIMITS if self.training else ""
        return model_card(manifest.name, about, depth_accuracy(measured), self.training, limits)
