"""Bundles of ONNX files with their manifest."""

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any, Literal

from dfvs_core.messages.manifest import BUNDLE_FORMAT, Graph, Manifest, sha256
from dfvs_core.messages.network_tensors import ImageInput
from dfvs_export.bundles.tracing import TensorNames
from dfvs_models.bundle import Bundle

BundleKind = Literal["pair", "encode-match", "mono", "pose"]


@dataclass(frozen=True, slots=True)
class Source:
    """Where a network comes from: its name, the origin of its weights, their licence."""

    name: str
    origin: str
    licence: str


def make_bundle(
    kind: BundleKind,
    graphs: Mapping[str, tuple[bytes, TensorNames]],
    images: ImageInput,
    source: Source,
    **outputs: Any,
) -> Bundle:
    """Bundle in fp32.

    Parameters
    ----------
    kind : str
        As manifests name it.
    graphs : mapping
        ONNX file and names of its tensors, by role.
    images : ImageInput
        What the graphs take.
    source : Source
    **outputs
        Fields of the manifest that say what the kind's outputs mean.
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
