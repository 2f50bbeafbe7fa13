"""Bundles in the making: ONNX files with a manifest and a model card, and how they are written."""

from __future__ import annotations

import shutil
from collections.abc import Mapping
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any, Literal

from dfvs_core.errors import ModelError
from dfvs_core.messages.manifest import BUNDLE_FORMAT, MANIFEST_NAME, Graph, Manifest, sha256
from dfvs_core.messages.network_tensors import DepthOutput, FlowOutput, ImageInput, PoseOutput
from dfvs_export.graphs import (
    ENCODE_INPUTS,
    ENCODE_OUTPUTS,
    MATCH_INPUTS,
    MATCH_OUTPUTS,
    OnnxPair,
)
from dfvs_models.bundle import Bundle

CARD_NAME = "MODEL_CARD.md"
ENCODE_FILE, MATCH_FILE, PAIR_FILE = "encode.onnx", "match.onnx", "pair.onnx"
MONO_FILE, POSE_FILE = "mono.onnx", "pose.onnx"
PAIR_INPUTS, PAIR_OUTPUTS = ("first", "second"), ("flow",)
POSE_INPUTS, POSE_OUTPUTS = ("first", "second", "focal"), ("translation", "rotation")


@dataclass(frozen=True, slots=True)
class Source:
    """Where a network comes from: its name, the origin of its weights, their licence."""

    name: str
    origin: str
    licence: str


def encode_match_bundle(onnx: OnnxPair, size: tuple[int, int], source: Source) -> Bundle:
    """Bundle of two graphs that were traced for grey images of ``size``, 0 to 255."""
    contents = {ENCODE_FILE: onnx.encode, MATCH_FILE: onnx.match}
    graphs = {
        "encode": Graph(ENCODE_FILE, ENCODE_INPUTS, ENCODE_OUTPUTS),
        "match": Graph(MATCH_FILE, MATCH_INPUTS, MATCH_OUTPUTS),
    }
    manifest = Manifest(
        format=BUNDLE_FORMAT,
        name=source.name,
        kind="encode-match",
        input=ImageInput(*size, multiple_of=32, channels="grey", scale=1.0),
        graphs=graphs,
        files=hashes(contents),
        licence=source.licence,
        origin=source.origin,
    )
    return Bundle(manifest, contents)


def pair_bundle(onnx: bytes, pictures: ImageInput, source: Source) -> Bundle:
    """Bundle of one graph that takes two pictures and gives their flow."""
    graph = Graph(PAIR_FILE, PAIR_INPUTS, PAIR_OUTPUTS)
    return _of_one_graph("pair", onnx, graph, pictures, source, flow=FlowOutput())


def mono_bundle(
    onnx: bytes,
    picture: ImageInput,
    names: tuple[tuple[str, ...], tuple[str, ...]],
    meaning: DepthOutput,
    source: Source,
) -> Bundle:
    """Bundle of one graph that gives depth; ``names`` are those of its inputs and outputs."""
    return _of_one_graph("mono", onnx, Graph(MONO_FILE, *names), picture, source, depth=meaning)


def pose_bundle(onnx: bytes, pictures: ImageInput, meaning: PoseOutput, source: Source) -> Bundle:
    """Bundle of one graph that takes two pictures and their focal length and gives their pose."""
    graph = Graph(POSE_FILE, POSE_INPUTS, POSE_OUTPUTS)
    return _of_one_graph("pose", onnx, graph, pictures, source, pose=meaning)


def _of_one_graph(
    kind: Literal["pair", "mono", "pose"],
    onnx: bytes,
    graph: Graph,
    images: ImageInput,
    source: Source,
    **outputs: Any,
) -> Bundle:
    """Bundle of a kind with a graph of its name; ``outputs`` are the manifest's of the kind."""
    contents = {graph.file: onnx}
    manifest = Manifest(
        format=BUNDLE_FORMAT,
        name=source.name,
        kind=kind,
        input=images,
        graphs={kind: graph},
        files=hashes(contents),
        licence=source.licence,
        origin=source.origin,
        **outputs,
    )
    return Bundle(manifest, contents)


def described(bundle: Bundle, card: str, accuracy: Mapping[str, float]) -> Bundle:
    """Return the bundle with a model card and its measured accuracy."""
    contents = {**bundle.contents, CARD_NAME: card.encode()}
    manifest = replace(bundle.manifest, files=hashes(contents), accuracy=dict(accuracy))
    return Bundle(manifest, contents)


def hashes(contents: Mapping[str, bytes]) -> dict[str, str]:
    """SHA-256 of every file, as manifests keep them."""
    return {name: sha256(data) for name, data in contents.items()}


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
