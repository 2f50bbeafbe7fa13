"""Folders of bundles: written whole or not at all, and only over another bundle."""

import shutil
from collections.abc import Mapping
from dataclasses import replace
from pathlib import Path

from dfvs_core.errors import ModelError
from dfvs_core.messages.manifest import MANIFEST_NAME, Manifest
from dfvs_export.bundles.manifest import hashes
from dfvs_models.bundle import Bundle

CARD_NAME = "MODEL_CARD.md"


def described(bundle: Bundle, card: str, accuracy: Mapping[str, float]) -> Bundle:
    """Return the bundle with a model card and its measured accuracy."""
    contents = {**bundle.contents, CARD_NAME: card.encode()}
    manifest = replace(bundle.manifest, files=hashes(contents), accuracy=dict(accuracy))
    return Bundle(manifest, contents)


def write_bundle(folder: Path, bundle: Bundle) -> None:
    """Write a bundle beside its place first, then move it there.

    Raises
    ------
    ModelError
        If the folder exists and is no bundle, or cannot be written.
    """
    check_free(folder)
    folder = folder.resolve()
    part = folder.with_name(folder.name + ".part")
    try:
        shutil.rmtree(part, ignore_errors=True)
        part.mkdir(parents=True)
        for name, data in bundle.contents.items():
            (part / name).write_bytes(data)
        (part / MANIFEST_NAME).write_text(bundle.manifest.to_json(), encoding="utf-8")
        shutil.rmtree(folder, ignore_errors=True)
        part.replace(folder)
    except OSError as error:
        shutil.rmtree(part, ignore_errors=True)
        raise ModelError(f"{folder} cannot be written ({error.strerror})") from error


def check_free(folder: Path) -> None:
    """Refuse to write where something else than a bundle is.

    Raises
    ------
    ModelError
        If the folder holds anything but a bundle, or cannot be looked at.
    """
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
