"""Published flow networks from ptlflow, as ``pair`` graphs; their weights loaded without trust.

A checkpoint of a stranger is a pickle, and a pickle runs code if let. So it is read as plain
tensors only (``weights_only=True``), and only if its SHA-256 is the one that the user names.
"""

from __future__ import annotations

import importlib
import io
import tempfile
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
import safetensors.torch
import torch
from torch import Tensor, nn

from dfvs_core.errors import ConfigError, ModelError
from dfvs_core.geometry.arrays import Float32Array
from dfvs_core.messages.manifest import Manifest, sha256
from dfvs_core.messages.network_tensors import ImageInput
from dfvs_export.bundles import PAIR_INPUTS, PAIR_OUTPUTS, Source, pair_bundle
from dfvs_export.calibration import ImagePair
from dfvs_export.card import accuracy_table
from dfvs_export.graphs import trace
from dfvs_export.running import BundleRunner
from dfvs_models.bundle import Bundle
from dfvs_models.evaluation import LevelScore

PREFIX = "ptlflow:"
_MULTIPLE = 16
_SAFETENSORS = ".safetensors"
_CARD = """# {name}

A published network, converted through ptlflow: {origin}.

- Input: {width} x {height} px, BGR, 0 to 1. Precision: {precision}.
- Its licence, and that of its weights, is its authors': look there before you use it.

## Accuracy
{accuracy}
"""


@dataclass(frozen=True, slots=True)
class ForeignWeights:
    """Where weights come from: a file, or a name that ptlflow knows; and the hash to expect.

    With neither, weights are drawn from ``seed``: good for trying the path, not for flying.
    """

    source: str | None = None
    sha256: str | None = None
    seed: int = 0


class PairGraph(nn.Module):
    """Two pictures (1, 3, H, W), BGR from 0 to 1, to flow (1, 2, H, W) px."""

    def __init__(self, network: nn.Module) -> None:
        super().__init__()
        self.network = network

    def forward(self, first: Tensor, second: Tensor) -> Tensor:
        """Stack the pictures as ptlflow wants them and take its flow."""
        flows: Tensor = self.network({"images": torch.stack([first, second], dim=1)})["flows"]
        return flows[:, 0]


def load_foreign(name: str, weights: ForeignWeights) -> nn.Module:
    """Network ``name`` of ptlflow in evaluation mode.

    Raises
    ------
    ConfigError
        If ptlflow is not installed, or has no such network or weights.
    ModelError
        If the weights are not what was announced, or hold more than tensors.
    """
    ptlflow = _ptlflow()
    torch.manual_seed(weights.seed)
    try:
        reference = ptlflow.get_model_reference(name)
    except ValueError as error:
        raise ConfigError(f"ptlflow has no network {name!r}", "a name that it lists") from error
    network: nn.Module = ptlflow.get_model(name)
    if weights.source is not None:
        data = _read_weights(reference, weights)
        try:
            network.load_state_dict(read_state(data, weights.source))
        except RuntimeError as error:
            raise ModelError(f"{weights.source} does not fit {name}", "weights for it") from error
    return network.eval()


def _ptlflow() -> Any:
    try:
        return importlib.import_module("ptlflow")
    except (ImportError, RuntimeError) as error:  # the latter for a torchvision of another build
        reason = str(error).splitlines()[0]
        raise ConfigError(
            f"ptlflow cannot be imported ({reason})",
            "it, with torchvision",
            "pip install 'dfvs-lab[published]'",
        ) from error


def _read_weights(reference: Any, weights: ForeignWeights) -> bytes:
    """Bytes of a checkpoint, whose hash was checked."""
    source = str(weights.source)
    if Path(source).is_file():
        data = Path(source).read_bytes()
    else:
        data = _download(getattr(reference, "pretrained_checkpoints", {}), source)
    return checked_digest(data, source, weights.sha256)


def checked_digest(data: bytes, source: str, expected: str | None) -> bytes:
    """Bytes of weights, which have to have the SHA-256 that the user names.

    Raises
    ------
    ModelError
        If it is another one, or none was named.
    """
    found = sha256(data)
    if expected is None:
        raise ModelError(
            f"{source} has SHA-256 {found}",
            "the hash to be named beforehand",
            f"check where the file comes from, then add --sha256 {found}",
        )
    if found != expected.lower():
        raise ModelError(f"{source} has SHA-256 {found}", expected.lower())
    return data


def _download(known: dict[str, str], name: str) -> bytes:
    if name not in known:
        listed = ", ".join(known) or "none"
        raise ConfigError(f"no weights {name!r}", f"a file, or one of: {listed}")
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / "weights"
        try:
            torch.hub.download_url_to_file(known[name], str(path), progress=True)
        except OSError as error:
            raise ModelError(
                f"{known[name]} cannot be fetched ({error})", "an internet connection"
            ) from error
        return path.read_bytes()


def read_state(data: bytes, name: str) -> dict[str, Tensor]:
    """Weights of a checkpoint (``.safetensors``, or torch's own kind) as plain tensors.

    Raises
    ------
    ModelError
        If it holds anything but plain data, or no weights.
    """
    try:
        if name.endswith(_SAFETENSORS):
            return safetensors.torch.load(data)
        found = torch.load(io.BytesIO(data), map_location="cpu", weights_only=True)
    except Exception as error:  # torch raises a dozen kinds for a bad file
        raise ModelError(
            f"{name} is no plain checkpoint: {type(error).__name__}", "tensors and nothing else"
        ) from error
    state = found.get("state_dict", found) if isinstance(found, dict) else None
    if not isinstance(state, dict) or not all(isinstance(v, Tensor) for v in state.values()):
        raise ModelError(f"{name} holds no weights", "a state_dict of tensors")
    return state


@dataclass(frozen=True, slots=True)
class PublishedFlow:
    """A network of ptlflow; a ``MatchingNetwork``."""

    name: str
    graph: PairGraph
    weights: ForeignWeights

    @classmethod
    def load(cls, name: str, weights: ForeignWeights) -> PublishedFlow:
        """Build the network and load its weights; see ``load_foreign`` for what is raised."""
        return cls(name, PairGraph(load_foreign(name, weights)).eval(), weights)

    @property
    def origin(self) -> str:
        """Where the weights come from, in words."""
        if self.weights.source is None:
            return "RANDOM weights, only to try out"
        return f"weights {self.weights.source}"

    def bundle(self, size: tuple[int, int]) -> Bundle:
        """Bundle in fp32 for pictures of ``size`` (width, height) px.

        Raises
        ------
        ModelError
            If torch cannot trace the network.
        """
        width, height = size
        g = torch.Generator().manual_seed(0)
        pictures = tuple(torch.rand(1, 3, height, width, generator=g) for _ in PAIR_INPUTS)
        try:
            onnx = trace(self.graph, pictures, (PAIR_INPUTS, PAIR_OUTPUTS))
        except RuntimeError as error:
            reason = str(error).splitlines()[0]
            raise ModelError(
                f"{self.name} cannot be exported: {reason}", "operators that ONNX has"
            ) from error
        source = Source(self.name, f"ptlflow {self.name}, {self.origin}", "see its authors")
        return pair_bundle(onnx, ImageInput(width, height, _MULTIPLE, channels="bgr"), source)

    def differences_px(self, runner: BundleRunner, pair: ImagePair) -> Float32Array:
        """How far the flow of ONNX Runtime is from torch's, at every pixel."""
        sides = [runner.encode(image) for image in pair]
        (flow,) = runner.match(*sides)
        with torch.no_grad():
            expected = self.graph(*(torch.from_numpy(side[0]) for side in sides)).numpy()
        return np.asarray(np.linalg.norm(flow - expected, axis=1).ravel(), np.float32)

    def card(self, manifest: Manifest, scores: Mapping[str, LevelScore], pairs_name: str) -> str:
        """Text of the model card; ``scores`` may be empty."""
        return _CARD.format(
            name=manifest.name,
            origin=self.origin,
            width=manifest.input.width,
            height=manifest.input.height,
            precision=manifest.precision,
            accuracy=accuracy_table(scores, pairs_name),
        )
