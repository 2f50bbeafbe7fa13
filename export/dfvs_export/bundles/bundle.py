"""Bundles: made of ONNX files, and written whole or not at all, only over another bundle."""

import shutil
from collections.abc import Mapping
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any, Literal

from dfvs_core.errors import ModelError
from dfvs_core.messages.manifest import BUNDLE_FORMAT, MANIFEST_NAME, Graph, Manifest, sha256
from dfvs_core.messages.network_tensors import ImageInput
from dfvs_export.bundles.tracing import TensorNames
from dfvs_models.bundle import Bundle

CARD_NAME = "MODEL_CARD.md"


@dataclass(frozen=True, slots=True)
class Source:
    """Where a network comes from: its name, the origin of its weights, their licence."""

    name: str
    origin: str
    licence: str


def make_bundle(
    kind: Literal["pair", "encode-match", "mono", "pose"],
    graphs: Mapping[str, tuple[bytes, TensorNames]],
    images: ImageInput,
    source: Source,
    **outputs: Any,
) -> Bundle:
    """Bundle in fp32 of graphs, each with its ONNX file and names of its tensors, by role.

    ``outputs`` are fields of the manifest that say what the kind's outputs mean.
    """
    contents = {f"{role}.onnx": onnx for role, (onnx, _) in graphs.items()}
    manifest = Manifest(
        format=BUNDLE_FORMAT,
        name=source.name,
        kind=kind,
        input=images,
        graphs={role: Graph(f"{role}.onnx", *names) for role, (_, names) in graphs.items()},
        files=hashes(contents),
        licence=source.licence,
        origin=source.origin,
        **outputs,
    )
    return Bundle(manifest, contents)


def hashes(contents: Mapping[str, bytes]) -> dict[str, str]:
    """SHA-256 of every file, as manifests keep them."""
    return {name: sha256(data) for name, data in contents.items()}


def write_bundle(folder: Path, bundle: Bundle, card: str, accuracy: Mapping[str, float]) -> None:
    """Write a bundle with its model card and accuracy beside its place, then move it there.

    Raises
    ------
    ModelError
        If the folder exists and is no bundle, or cannot be written.
    """
    check_free(folder)
    contents = {**bundle.contents, CARD_NAME: card.encode()}
    manifest = replace(bundle.manifest, files=hashes(contents), accuracy=dict(accuracy))
    folder = folder.resolve()
    part = folder.with_name(folder.name + ".part")
    try:
        shutil.rmtree(part, ignore_errors=True)
        part.mkdir(parents=True)
        for name, data in contents.items():
            (part / name).write_bytes(data)
        (part / MANIFEST_NAME).write_text(manifest.to_json(), encoding="utf-8")
        shutil.rmtree(folder, ignore_errors=True)
        part.replace(folder)
    except OSError as error:
        shutil.rmtree(part, ignore_errors=True)
        raise ModelError(f"{folder} cannot be written ({error.strerror})") from error


def check_free(folder: Path) -> None:
    """Refuse to write where something else than a bundle is, or nothing can be seen: ModelError."""
    try:
        if folder.exists() and not folder.is_dir():
            raise ModelError(f"{folder} is no folder", "a new folder, or a bundle")
        if folder.is_dir() and any(folder.iterdir()) and not _holds_a_bundle(folder):
            raise ModelError(f"{folder} is not empty and no bundle", "a new folder, or a bundle")
    except OSError as error:
        raise ModelError(f"{folder} cannot be read ({error.strerror})") from error


def _holds_a_bundle(folder: Path) -> bool:
    """Whether there is a manifest of ours, and nothing that it does not name."""
    path = folder / MANIFEST_NAME
    try:
        manifest = Manifest.from_json(path.read_bytes()) if path.is_file() else None
    except ModelError:
        return False
    ours = {MANIFEST_NAME, *(manifest.files if manifest else ())}
    return manifest is not None and {entry.name for entry in folder.iterdir()} <= ours
