"""Bundles: ONNX files with a manifest and a model card, written and read back."""

from __future__ import annotations

import shutil
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path

from dfvs_core.errors import ModelError
from dfvs_core.manifest import (
    BUNDLE_FORMAT,
    MANIFEST_NAME,
    FlowOutput,
    Graph,
    Manifest,
    PictureInput,
    check_files,
    sha256,
)
from dfvs_export.onnx_pair import (
    ENCODE_INPUTS,
    ENCODE_OUTPUTS,
    MATCH_INPUTS,
    MATCH_OUTPUTS,
    OnnxPair,
)

CARD_NAME = "MODEL_CARD.md"
ENCODE_FILE, MATCH_FILE = "encode.onnx", "match.onnx"


@dataclass(frozen=True, slots=True)
class BundleText:
    """What people are told of a bundle: name, origin of the weights, accuracy, model card."""

    name: str
    origin: str
    accuracy: Mapping[str, float]
    card: str
    licence: str = "Apache-2.0"


def write_flow_bundle(
    folder: Path, onnx: OnnxPair, size: tuple[int, int], text: BundleText
) -> Manifest:
    """Write an ``encode-match`` bundle, whole or not at all.

    Raises
    ------
    ModelError
        If the folder exists and is no bundle.
    """
    contents = {
        ENCODE_FILE: onnx.encode,
        MATCH_FILE: onnx.match,
        CARD_NAME: text.card.encode(),
    }
    manifest = Manifest(
        format=BUNDLE_FORMAT,
        name=text.name,
        kind="encode-match",
        input=PictureInput(width=size[0], height=size[1], multiple_of=16),
        graphs={
            "encode": Graph(ENCODE_FILE, ENCODE_INPUTS, ENCODE_OUTPUTS),
            "match": Graph(MATCH_FILE, MATCH_INPUTS, MATCH_OUTPUTS),
        },
        files={name: sha256(data) for name, data in contents.items()},
        licence=text.licence,
        origin=text.origin,
        flow=FlowOutput(),
        matching="hybrid",
        accuracy=dict(text.accuracy),
    )
    write_bundle(folder, manifest, contents)
    return manifest


def write_bundle(folder: Path, manifest: Manifest, contents: Mapping[str, bytes]) -> None:
    """Write a bundle beside its place first, then move it there.

    Raises
    ------
    ModelError
        If the folder exists and is no bundle.
    """
    if folder.exists() and not (folder / MANIFEST_NAME).is_file() and any(folder.iterdir()):
        raise ModelError(f"{folder} is not empty and no bundle", "a new folder, or a bundle")
    part = folder.with_name(folder.name + ".part")
    shutil.rmtree(part, ignore_errors=True)
    part.mkdir(parents=True)
    for name, data in contents.items():
        (part / name).write_bytes(data)
    (part / MANIFEST_NAME).write_text(manifest.to_json(), encoding="utf-8")
    shutil.rmtree(folder, ignore_errors=True)
    part.replace(folder)


def read_bundle(folder: Path) -> tuple[Manifest, dict[str, bytes]]:
    """Return manifest and verified contents of a bundle.

    Raises
    ------
    ModelError
        If something is missing, damaged or not announced.
    """
    path = folder / MANIFEST_NAME
    if not path.is_file():
        raise ModelError(f"{folder} is no bundle", f"a folder with {MANIFEST_NAME}")
    manifest = Manifest.from_json(path.read_bytes())
    contents = {
        file.name: file.read_bytes()
        for file in sorted(folder.iterdir())
        if file.is_file() and file.name != MANIFEST_NAME
    }
    check_files(manifest, contents)
    return manifest, contents
