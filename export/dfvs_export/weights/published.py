"""Weights of published networks, loaded without trust; flow networks from ptlflow.

A checkpoint of a stranger is a pickle, and a pickle runs code if let. So it is read as plain
tensors only (``weights_only=True``), and only if its SHA-256 is the one that the user names.
"""

import importlib
import io
import tempfile
from pathlib import Path
from typing import Any

import safetensors.torch
import torch
from torch import Tensor, nn

from dfvs_core.errors import ConfigError, ModelError
from dfvs_export.weights.checkpoint import checked_digest, fill

_SAFETENSORS = ".safetensors"
_SEED = 0


def load_foreign(name: str, source: str | None, digest: str | None) -> nn.Module:
    """Network ``name`` of ptlflow in evaluation mode.

    Its weights come from the ``source``, a file or a name that ptlflow knows, and have the SHA-256
    ``digest``. Without a source they are random, of a fixed seed: to try the path, not to fly.

    Raises
    ------
    ConfigError
        If ptlflow is not installed, or has no such network or weights.
    ModelError
        If the weights are not what was announced, or hold more than tensors.
    """
    ptlflow = _ptlflow()
    torch.manual_seed(_SEED)
    try:
        reference = ptlflow.get_model_reference(name)
    except ValueError as error:
        raise ConfigError(f"ptlflow has no network {name!r}", "a name that it lists") from error
    network: nn.Module = ptlflow.get_model(name)
    if source is not None:
        state = read_state(_read_weights(reference, source, digest), source)
        fill(network, state, f"{source} does not fit {name}", "weights for it")
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


def _read_weights(reference: Any, source: str, digest: str | None) -> bytes:
    """Bytes of a checkpoint, whose hash was checked."""
    if Path(source).is_file():
        data = Path(source).read_bytes()
    else:
        data = _download(getattr(reference, "pretrained_checkpoints", {}), source)
    return checked_digest(data, source, digest)


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
