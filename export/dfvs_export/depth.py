"""Depth networks as ``mono`` bundles: ours and published ones."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import torch
from torch import Tensor, nn

from dfvs_core.depth.network import DepthUnit
from dfvs_core.errors import ConfigError, ModelError
from dfvs_core.geometry.arrays import Float32Array, ImageArray
from dfvs_core.messages.manifest import Manifest
from dfvs_core.messages.network_tensors import DepthOutput, ImageInput
from dfvs_export.bundles import Source, mono_bundle
from dfvs_export.depth_weights import load_depth_weights
from dfvs_export.foreign import checked_digest, read_state
from dfvs_export.graphs import trace
from dfvs_export.networks.densedepth import DenseDepth
from dfvs_export.networks.depth_anything import WEIGHTS_NAME, DepthAnything
from dfvs_export.networks.midas_small import MidasSmall
from dfvs_export.running import FOCAL, BundleRunner
from dfvs_models.bundle import Bundle
from dfvs_models.depth_evaluation import MeasuredDepth

OWN, DENSE, ANYTHING, MIDAS = "dfvs-depth", "densedepth", "depth-anything-v2-small", "midas-small"
_INPUTS, _OUTPUTS = ("image", "focal"), ("depth", "spread")
_SEED = 0
_LEAST_RANGE = 0.01
"""Range of an output over its size, below which differences are of rounding."""
_LEAST_SPREAD, _MOST_SPREAD = 0.001, 10.0
_MEAN, _STD = (0.485, 0.456, 0.406), (0.229, 0.224, 0.225)
"""Of ImageNet's images."""
_CARD = """# {name}

Depth of one image along the optical axis. Origin: {origin}.

- Input: {width} x {height} px, RGB{focal}. Precision: {precision}.
- Output: {quantity}, unit {unit}, every {stride} px, with {spread}.
- Licence: {licence}.

{training}## Accuracy
{accuracy}
{limits}"""
_LIMITS = """
## What it is bad at
- Rooms and light unlike those that it was trained on; views from close to a wall.
- The size of things: its scale is a guess from what rooms are like, which motion corrects.
- Mirrors, glass and the open sky.
"""


@dataclass(frozen=True, slots=True)
class Spreads:
    """Standard deviations of the logarithm of depth that a manifest states.

    ``local`` is that of a network that does not estimate its own, ``scale`` that of a metric
    network's whole scale.
    """

    local: float = 0.3
    scale: float = 0.2

    def __post_init__(self) -> None:
        """Refuse what no manifest may state."""
        for option, value in (("spread", self.local), ("scale-spread", self.scale)):
            if not _LEAST_SPREAD <= value <= _MOST_SPREAD:
                raise ConfigError(
                    f"--{option} is {value:g}", f"{_LEAST_SPREAD:g} to {_MOST_SPREAD:g}"
                )


@dataclass(frozen=True, slots=True)
class DepthWeights:
    """Where weights come from; none: random ones of a fixed seed, to try the path with.

    ``folder`` is one that ``transformers`` saved; ``sha256`` what published weights hash to.
    """

    checkpoint: Path | None = None
    folder: Path | None = None
    sha256: str | None = None

    @property
    def is_random(self) -> bool:
        """Whether none are named."""
        return self.checkpoint is None and self.folder is None

    @property
    def origin(self) -> str:
        """Where they come from, in words."""
        if self.is_random:
            return "RANDOM weights, only to try out"
        return f"weights {(self.checkpoint or self.folder or Path()).name}"


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
        torch.manual_seed(_SEED)
        if name == OWN:
            own = load_depth_weights(weights.checkpoint)
            origin = f"{own.origin}, trained on by this project, weights {own.digest}"
            return cls(name, own.network(), origin, own.training)
        return cls(name, _LOADERS[name](weights).eval(), f"{name}, {weights.origin}")

    def bundle(self, size: tuple[int, int] | None, spreads: Spreads) -> Bundle:
        """Bundle in fp32 for images of ``size`` (width, height) px, or of the network's own.

        Raises
        ------
        ConfigError
            If the network takes no images of this size.
        ModelError
            If torch cannot trace it.
        """
        kind = _KINDS[self.name]
        width, height = size or kind.size
        if width % kind.multiple or height % kind.multiple:
            raise ConfigError(f"size {width}x{height}", f"multiples of {kind.multiple}")
        if self.name == OWN and (width, height) != kind.size:
            raise ConfigError(f"size {width}x{height}", f"{kind.size[0]}x{kind.size[1]} for {OWN}")
        inputs = _INPUTS[: 2 if self.name == OWN else 1]
        outputs = _OUTPUTS[: 2 if kind.estimates_spread else 1]
        image = torch.rand(1, 3, height, width, generator=torch.Generator().manual_seed(_SEED))
        example = (image, torch.full((1, 1), FOCAL))[: len(inputs)]
        try:
            onnx = trace(self.module, example, (inputs, outputs))
        except RuntimeError as error:
            reason = str(error).splitlines()[0]
            raise ModelError(
                f"{self.name} cannot be exported: {reason}", "operators that ONNX has"
            ) from error
        picture = ImageInput(width, height, kind.multiple)
        if kind.is_normalised:
            picture = ImageInput(width, height, kind.multiple, mean=_MEAN, std=_STD)
        source = Source(self.name, self.origin, kind.licence)
        return mono_bundle(onnx, picture, (inputs, outputs), self._meaning(kind, spreads), source)

    def _meaning(self, kind: _Kind, spreads: Spreads) -> DepthOutput:
        local = None if kind.estimates_spread else spreads.local
        if isinstance(self.module, DepthAnything) and self.module.is_metric:
            return DepthOutput("depth", "m", kind.stride, local, spreads.scale)
        scale = spreads.scale if kind.unit == "1/m" else None
        return DepthOutput("inverse-depth", kind.unit, kind.stride, local, scale)

    def differences(self, runner: BundleRunner, image: ImageArray) -> Float32Array:
        """How far ONNX Runtime's outputs are from torch's, over the range of torch's values."""
        tensors = runner.encode(image)
        found = runner.match(tensors, tensors)
        with torch.no_grad():
            outputs = self.module(*(torch.from_numpy(tensor) for tensor in tensors))
        expected = (outputs,) if isinstance(outputs, Tensor) else outputs
        apart = [
            np.abs(a - b).ravel() / max(float(np.ptp(b)), _LEAST_RANGE * float(np.abs(b).max()))
            for a, b in zip(found, (each.numpy() for each in expected), strict=True)
        ]
        return np.concatenate(apart).astype(np.float32)

    def card(self, manifest: Manifest, measured: Mapping[str, MeasuredDepth]) -> str:
        """Text of the model card; ``measured`` by the file's name may be empty."""
        meaning, graph = manifest.depth, manifest.graphs["mono"]
        assert meaning is not None
        stated = f"a standard deviation of its logarithm of {meaning.spread} (assumed)"
        return _CARD.format(
            name=manifest.name,
            origin=manifest.origin,
            width=manifest.input.width,
            height=manifest.input.height,
            focal=" and the focal length over the width" if len(graph.inputs) > 1 else "",
            precision=manifest.precision,
            quantity=meaning.quantity.replace("-", " "),
            unit=meaning.unit,
            stride=meaning.stride,
            spread="the standard deviation of its logarithm" if meaning.spread is None else stated,
            licence=manifest.licence,
            training=f"## Training\n{self.training}\n\n" if self.training else "",
            accuracy=_accuracy(measured),
            limits=_LIMITS if self.name == OWN else "",
        )


def _accuracy(measured: Mapping[str, MeasuredDepth]) -> str:
    """Table of errors by file, or that nothing was measured."""
    if not measured:
        return "Not measured for this bundle."
    lines = ["| images | depth | abs-rel | RMSE | within 25 % |", "|---|---|---|---|---|"]
    for name, result in measured.items():
        errors = {"metric": result.score.metric, "scale aligned": result.score.aligned}
        lines += [
            f"| {result.images} of `{name}` | {kind} | {e.abs_rel:.3f} | {e.rmse_m:.2f} m "
            f"| {100 * e.close:.1f} % |"
            for kind, e in errors.items()
            if e is not None
        ]
    lines += [""] + [
        f"On `{name}` ln of the scale is off by {r.score.scale_log:.2f} (rms), and "
        f"{100 * r.score.within_spread:.0f} % of pixels lie within the stated uncertainty."
        for name, r in measured.items()
    ]
    return "\n".join(lines)


def _dense(weights: DepthWeights) -> nn.Module:
    network = DenseDepth()
    if weights.checkpoint is None:
        nn.init.constant_(network.head_bias, 3.0)  # within the range that it is limited to
    return _filled(network, weights)


def _midas(weights: DepthWeights) -> nn.Module:
    network = MidasSmall()
    if weights.checkpoint is None:
        nn.init.constant_(network.head_bias, 1.0)  # below 0 nothing would be left
    return _filled(network, weights)


def _anything(weights: DepthWeights) -> nn.Module:
    if weights.folder is None:
        return DepthAnything()
    _read(weights.folder / WEIGHTS_NAME, weights.sha256)
    return DepthAnything(weights.folder)


_LOADERS: Mapping[str, Callable[[DepthWeights], nn.Module]] = {
    DENSE: _dense,
    ANYTHING: _anything,
    MIDAS: _midas,
}


def _filled(network: nn.Module, weights: DepthWeights) -> nn.Module:
    """The network with the weights of a published checkpoint, if one is named."""
    path = weights.checkpoint
    if path is None:
        return network
    state = read_state(_read(path, weights.sha256), path.name)
    try:
        network.load_state_dict(state)
    except RuntimeError as error:
        raise ModelError(f"{path} does not fit the network", "weights for it") from error
    return network


def _read(path: Path, sha256: str | None) -> bytes:
    """Bytes of a file whose hash is the one that was named."""
    try:
        data = path.read_bytes()
    except OSError as error:
        raise ModelError(f"{path} cannot be read ({error.strerror})") from error
    return checked_digest(data, str(path), sha256)
