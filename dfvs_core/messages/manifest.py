"""Manifest of a model bundle: graphs, tensors, files with SHA-256, licence and accuracy.

A bundle is a folder with ``manifest.json`` and ONNX files. The manifest names every file with
its SHA-256, says how images go in and how flow comes out, where the weights come from and
under which licence, and how accurate they were measured to be.
"""

from __future__ import annotations

import hashlib
import json
import re
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from typing import Literal, TypeVar

from dfvs_core.errors import ConfigError, ModelError
from dfvs_core.messages.network_tensors import DepthOutput, FlowOutput, ImageInput, PoseOutput
from dfvs_core.messages.schema import parse, to_text

BUNDLE_FORMAT = "dfvs-bundle/2"
MANIFEST_NAME = "manifest.json"

T = TypeVar("T")

_FILE_NAME = re.compile(r"[A-Za-z0-9][A-Za-z0-9._-]{0,127}")
_SHA256 = re.compile(r"[0-9a-f]{64}")

GRAPHS_OF_KIND: Mapping[str, tuple[str, ...]] = {
    "pair": ("pair",),
    "encode-match": ("encode", "match"),
    "mono": ("mono",),
    "pose": ("pose",),
}
"""Roles of the graphs that a bundle of each kind holds."""


@dataclass(frozen=True, slots=True)
class Graph:
    """An ONNX file of the bundle and the names of its tensors, in order."""

    file: str
    inputs: tuple[str, ...]
    outputs: tuple[str, ...]


@dataclass(frozen=True, slots=True)
class Manifest:
    """A bundle's manifest; see the module's text.

    ``accuracy`` maps a measure (such as ``small_epe_px``) to its value; ``files`` maps every
    file of the bundle but the manifest to its SHA-256. ``precision`` is that of its heavy
    operators; what goes in and comes out is float32 at any.
    """

    format: str
    name: str
    kind: Literal["pair", "encode-match", "mono", "pose"]
    input: ImageInput
    graphs: dict[str, Graph]
    files: dict[str, str]
    licence: str
    origin: str
    flow: FlowOutput | None = None
    depth: DepthOutput | None = None
    pose: PoseOutput | None = None
    precision: Literal["fp32", "fp16", "int8"] = "fp32"
    accuracy: dict[str, float] = field(default_factory=dict)

    def __post_init__(self) -> None:
        """Refuse what contradicts itself, and names that could leave the folder."""
        if self.format != BUNDLE_FORMAT:
            raise ModelError(f"bundle has format {self.format!r}", repr(BUNDLE_FORMAT))
        for name, digest in self.files.items():
            if not _FILE_NAME.fullmatch(name):
                raise ModelError(f"bundle names the file {name!r}", "a plain name without folders")
            if not _SHA256.fullmatch(digest):
                raise ModelError(f"SHA-256 of {name!r} is {digest!r}", "64 hexadecimal digits")
        roles = GRAPHS_OF_KIND[self.kind]
        if sorted(self.graphs) != sorted(roles):
            raise ModelError(
                f"a {self.kind!r} bundle has the graphs {sorted(self.graphs)}", f"{sorted(roles)}"
            )
        for role, graph in self.graphs.items():
            if graph.file not in self.files:
                raise ModelError(f"graph {role!r} is in {graph.file!r}", "a file listed in 'files'")
        self._check_outputs()

    def _check_outputs(self) -> None:
        for kind, name, output in (
            ("pair", "flow", self.flow),
            ("mono", "depth", self.depth),
            ("pose", "pose", self.pose),
        ):
            if (self.kind == kind) != (output is not None):
                raise ModelError(
                    f"a {self.kind!r} bundle {'lacks' if output is None else 'has'} {name!r}",
                    f"{name!r} for networks that give {name}, and only for those",
                )
        if self.kind == "pair":
            self._check_pair(len(self.input.pair_shapes()), outputs=1)
        if self.kind == "pose":
            self._check_pair(len(self.input.pair_shapes()) + 1, outputs=2)
        if self.depth is not None:
            self._check_mono(self.depth)

    def match_feeds(self, first: Sequence[T], second: Sequence[T]) -> dict[str, T]:
        """Name what goes into the graph ``match``: the first outputs of ``encode`` of both images.

        An input of ``match`` has the name of an output of ``encode`` after ``first_`` (the
        image that the flow starts from) or ``second_``.

        Raises
        ------
        ModelError
            If an input has another name.
        """
        made: dict[str, T] = {}
        for side, features in (("first_", first), ("second_", second)):
            names = self.graphs["encode"].outputs
            made |= {side + name: x for name, x in zip(names, features, strict=False)}
        wanted = self.graphs["match"].inputs
        if unknown := sorted(set(wanted) - set(made)):
            raise ModelError(f"graph 'match' takes {unknown}", f"some of {sorted(made)}")
        return {name: made[name] for name in wanted}

    def _check_pair(self, inputs: int, outputs: int) -> None:
        graph = self.graphs[self.kind]
        if len(graph.inputs) != inputs or len(graph.outputs) != outputs:
            raise ModelError(
                f"graph {self.kind!r} has {len(graph.inputs)} inputs and {len(graph.outputs)}"
                " outputs",
                f"{inputs} and {outputs} for the layout {self.input.layout!r}",
            )
        if self.flow is not None:
            self._check_stride("flow", self.flow.stride)

    def _check_mono(self, depth: DepthOutput) -> None:
        graph = self.graphs["mono"]
        if len(graph.inputs) not in (1, 2) or len(graph.outputs) not in (1, 2):
            raise ModelError(
                f"graph 'mono' has {len(graph.inputs)} inputs and {len(graph.outputs)} outputs",
                "an image and perhaps its focal length; depth and perhaps its spread",
            )
        if (len(graph.outputs) == 1) != (depth.spread is not None):
            raise ModelError(
                f"graph 'mono' has {len(graph.outputs)} outputs and depth"
                f" {'no' if depth.spread is None else 'a'} 'spread'",
                "the spread as a second output, or else in the manifest",
            )
        self._check_stride("depth", depth.stride)

    def _check_stride(self, name: str, stride: int) -> None:
        if self.input.width % stride or self.input.height % stride:
            raise ModelError(
                f"{name} stride {stride}",
                f"a divisor of {self.input.width} and {self.input.height}",
            )

    def to_json(self) -> str:
        """Text of ``manifest.json``."""
        return to_text(self)

    @classmethod
    def from_json(cls, data: bytes) -> Manifest:
        """Read ``manifest.json``.

        Raises
        ------
        ModelError
            If it is not JSON, does not follow the schema, or contradicts itself.
        """
        try:
            return parse(cls, json.loads(data))
        except (ValueError, RecursionError) as error:
            raise ModelError(f"the manifest is not JSON ({error})") from error
        except ConfigError as error:
            raise ModelError(f"manifest: {error.problem}", error.expected, error.remedy) from error


def sha256(data: bytes) -> str:
    """SHA-256 as manifests write it."""
    return hashlib.sha256(data).hexdigest()


def check_files(manifest: Manifest, contents: Mapping[str, bytes]) -> None:
    """Check the contents of a bundle's files against its manifest.

    Raises
    ------
    ModelError
        If a file is missing, was not announced, or is not what was announced.
    """
    for name in manifest.files:
        if name not in contents:
            raise ModelError(f"bundle {manifest.name!r} lacks the file {name!r}")
    for name, data in contents.items():
        if name not in manifest.files:
            raise ModelError(f"bundle {manifest.name!r} holds {name!r}, which it does not list")
        digest = sha256(data)
        if digest != manifest.files[name]:
            raise ModelError(
                f"{name!r} of bundle {manifest.name!r} has SHA-256 {digest[:16]}...",
                f"{manifest.files[name][:16]}...",
                "the file is damaged or was changed: fetch the bundle again",
            )
