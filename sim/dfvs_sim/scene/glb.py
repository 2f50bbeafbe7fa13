"""Read any unlit or baked glTF binary (.glb) as a scene.

What is seen is base colour texture x base colour factor x COLOR_0, as the extension
KHR_materials_unlit has it. Where the base colour is black or absent, the emission stands for it:
light is baked into it. Normals, metalness, lights and transparency are not used.
"""

import json
import struct
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from dfvs_common.progress import warn
from dfvs_core.errors import DfvsError
from dfvs_core.geometry.arrays import Float32Array, FloatArray
from dfvs_core.geometry.poses import rotation_from_quaternion
from dfvs_core.messages.image import decode_image
from dfvs_sim.scene.frames import ned_from_gltf
from dfvs_sim.scene.glb_accessor import Document, read_accessor, read_view
from dfvs_sim.scene.glb_material import Material, ignored_features, material_of
from dfvs_sim.scene.mesh import Int32Array, Scene
from dfvs_sim.scene.texture import Texture, Wrap

MAX_TEXTURE_PIXELS = 8192 * 8192
_FAR_M = 2000.0
"""Reach of a scene above which single precision is felt, or its unit is not the metre."""
_MAGIC, _JSON_CHUNK, _BINARY_CHUNK = 0x46546C67, 0x4E4F534A, 0x004E4942
_TRIANGLES, _STRIP, _FAN = 4, 5, 6
_SUPPORTED = frozenset({"KHR_materials_unlit", "KHR_mesh_quantization", "KHR_texture_transform"})
_WRAP = {10497: Wrap.REPEAT, 33071: Wrap.CLAMP, 33648: Wrap.MIRROR}
_PLAIN = "export it as plain GLB, without mesh or texture compression"


class GlbError(DfvsError):
    """A scene file that cannot be read."""


@dataclass(frozen=True, slots=True)
class _Part:
    """One primitive, in the file's axes."""

    vertices: FloatArray
    triangles: Int32Array
    uv: Float32Array
    colours: Float32Array
    texture: int


def load_glb(path: str | Path) -> Scene:
    """Read a GLB file as a scene in NED.

    Raises
    ------
    GlbError
        If the file cannot be read, is not a binary glTF 2.0, needs an extension that is not
        supported (Draco, for example), is damaged, or has no triangles.
    """
    path = Path(path)
    try:
        data = path.read_bytes()
    except OSError as error:
        raise GlbError(f"scene {path} cannot be read ({error.strerror})", "a .glb file") from error
    try:
        document = _parse(data)
        scene, ignored = _scene(document), ignored_features(document.json)
    except DfvsError as error:
        raise GlbError(f"scene {path}: {error.problem}", error.expected, error.remedy) from error
    except (KeyError, IndexError, TypeError, ValueError, AttributeError) as error:
        raise GlbError(
            f"scene {path} is damaged ({type(error).__name__}: {error})", "a valid glTF 2.0 binary"
        ) from error
    if ignored:
        warn(f"scene {path}: ignored {' and '.join(ignored)}; what has it is drawn plain")
    if (reach_m := np.abs(scene.vertices).max()) > _FAR_M:
        warn(
            f"scene {path} reaches {reach_m:.0f} m from its origin, where positions are rounded to"
            f" {1e3 * np.spacing(reach_m):.1f} mm; move it to the origin, in metres"
        )
    return scene


def _parse(data: bytes) -> Document:
    """Split the file into its JSON document and its binary chunk."""
    if len(data) < 20 or struct.unpack_from("<I", data)[0] != _MAGIC:
        raise GlbError(f"the file begins with {data[:4]!r}", "a binary glTF (.glb)")
    version, length = struct.unpack_from("<II", data, 4)
    if version != 2 or length > len(data):
        raise GlbError(
            f"glTF version {version}, {length} bytes announced, {len(data)} there",
            "version 2, complete",
        )
    document: dict[str, Any] | None = None
    binary = b""
    at = 12
    while at + 8 <= length:
        size, kind = struct.unpack_from("<II", data, at)
        chunk = data[at + 8 : at + 8 + size]
        if kind == _JSON_CHUNK and document is None:
            document = json.loads(chunk)
        elif kind == _BINARY_CHUNK and not binary:
            binary = chunk
        at += 8 + size
    if not isinstance(document, dict):
        raise GlbError("the file has no JSON chunk", "a binary glTF (.glb)")
    _check_extensions(document)
    return Document(document, binary)


def _check_extensions(document: dict[str, Any]) -> None:
    """Refuse files that cannot be drawn without an extension we do not have."""
    missing = sorted(set(document.get("extensionsRequired", [])) - _SUPPORTED)
    if missing:
        raise GlbError(
            f"the file requires {', '.join(missing)}", f"no more than {sorted(_SUPPORTED)}", _PLAIN
        )


def _scene(document: Document) -> Scene:
    """Gather all primitives of the default scene into one mesh."""
    parts = [
        part
        for matrix, mesh in _placed_meshes(document.json)
        for part in _parts(document, mesh, matrix)
    ]
    if not parts:
        raise GlbError("the file has no triangles", "a mesh with at least one triangle")
    first = np.cumsum([0] + [len(p.vertices) for p in parts[:-1]])
    return Scene(
        vertices=ned_from_gltf(np.concatenate([p.vertices for p in parts])).astype(np.float32),
        triangles=np.concatenate(
            [p.triangles + n for p, n in zip(parts, first, strict=True)]
        ).astype(np.int32),
        uv=np.concatenate([p.uv for p in parts]),
        colours=np.concatenate([p.colours for p in parts]),
        texture_index=np.concatenate(
            [np.full(len(p.triangles), p.texture, np.int32) for p in parts]
        ),
        textures=tuple(_texture(document, k) for k in document.json.get("textures", [])),
    )


def _placed_meshes(gltf: dict[str, Any]) -> Iterator[tuple[FloatArray, dict[str, Any]]]:
    """Walk the node tree: (matrix (4, 4) to the scene, mesh) of every mesh in it."""
    nodes = gltf.get("nodes", [])
    scenes = gltf.get("scenes")
    children = {c for node in nodes for c in node.get("children", [])}
    orphans = [k for k in range(len(nodes)) if k not in children]
    roots = scenes[gltf.get("scene", 0)].get("nodes", []) if scenes else orphans
    stack = [(np.eye(4), int(k), 0) for k in roots]
    while stack:
        parent, k, generation = stack.pop()
        if generation > len(nodes):
            raise GlbError("the node tree has a loop", "a tree")
        matrix = parent @ _node_matrix(nodes[k])
        if "mesh" in nodes[k]:
            yield matrix, gltf["meshes"][nodes[k]["mesh"]]
        stack += [(matrix, int(c), generation + 1) for c in nodes[k].get("children", [])]


def _node_matrix(node: dict[str, Any]) -> FloatArray:
    """Matrix (4, 4) of a node, from its matrix or from translation, rotation and scale."""
    if "matrix" in node:
        return np.array(node["matrix"], dtype=np.float64).reshape(4, 4).T
    x, y, z, w = node.get("rotation", (0.0, 0.0, 0.0, 1.0))
    matrix = np.eye(4)
    scale = np.array(node.get("scale", (1.0, 1.0, 1.0)), dtype=np.float64)
    matrix[:3, :3] = rotation_from_quaternion(np.array([w, x, y, z])) * scale
    matrix[:3, 3] = node.get("translation", (0.0, 0.0, 0.0))
    return matrix


def _parts(document: Document, mesh: dict[str, Any], matrix: FloatArray) -> Iterator[_Part]:
    """Triangles of a mesh's primitives, placed in the scene."""
    for primitive in mesh["primitives"]:
        if primitive.get("mode", _TRIANGLES) not in (_TRIANGLES, _STRIP, _FAN):
            continue
        if "KHR_draco_mesh_compression" in primitive.get("extensions", {}):
            raise GlbError("a mesh is compressed with Draco", "plain vertex data", _PLAIN)
        attributes = primitive["attributes"]
        positions = read_accessor(document, attributes["POSITION"]).astype(np.float64)
        material = material_of(document.json, primitive)
        triangles = _triangles(document, primitive, len(positions))
        if len(triangles) == 0:
            continue
        yield _Part(
            vertices=positions @ matrix[:3, :3].T + matrix[:3, 3],
            triangles=triangles,
            uv=_uv(document, attributes, material, len(positions)),
            colours=_colours(document, attributes, material, len(positions)),
            texture=material.texture,
        )


def _triangles(document: Document, primitive: dict[str, Any], count: int) -> Int32Array:
    """Vertex indices (M, 3) of a primitive: indexed or not, list, strip or fan."""
    if "indices" in primitive:
        indices = read_accessor(document, primitive["indices"]).reshape(-1).astype(np.int64)
    else:
        indices = np.arange(count)
    if len(indices) and (indices.min() < 0 or indices.max() >= count):
        raise GlbError(
            f"vertex indices are {indices.min()} to {indices.max()}", f"0 to {count - 1}"
        )
    mode = primitive.get("mode", _TRIANGLES)
    if mode == _TRIANGLES:
        triangles = indices[: len(indices) // 3 * 3].reshape(-1, 3)
    elif mode == _STRIP:
        triangles = np.stack([indices[:-2], indices[1:-1], indices[2:]], axis=1)
    else:
        triangles = np.stack(
            [np.broadcast_to(indices[:1], len(indices[2:])), indices[1:-1], indices[2:]], axis=1
        )
    return triangles.astype(np.int32)


def _uv(
    document: Document, attributes: dict[str, int], material: Material, count: int
) -> Float32Array:
    """Texture coordinates (N, 2) of a primitive, transformed as KHR_texture_transform says."""
    if not material.has_coordinates(attributes):
        return np.zeros((count, 2), np.float32)
    uv = read_accessor(document, attributes[material.uv_name]).astype(np.float64)
    c, s = np.cos(material.uv_rotation_rad), np.sin(material.uv_rotation_rad)
    scaled = uv * np.array(material.uv_scale)
    turned = scaled @ np.array([[c, s], [-s, c]]).T + np.array(material.uv_offset)
    return np.asarray(turned, dtype=np.float32)


def _colours(
    document: Document, attributes: dict[str, int], material: Material, count: int
) -> Float32Array:
    """Linear light (N, 3) of a primitive: COLOR_0 x base colour factor."""
    factor = np.array(material.factor[:3], dtype=np.float32)
    if "COLOR_0" not in attributes:
        return np.tile(factor, (count, 1))
    colours = read_accessor(document, attributes["COLOR_0"])[:, :3]
    return np.asarray(colours * factor, dtype=np.float32)


def _texture(document: Document, texture: dict[str, Any]) -> Texture:
    """Decode one texture's image."""
    if "source" not in texture:
        names = ", ".join(texture.get("extensions", {})) or "no image"
        raise GlbError(f"a texture has {names}", "PNG or JPEG", _PLAIN)
    image = document.json["images"][texture["source"]]
    if "bufferView" not in image:
        raise GlbError(
            f"a texture lies outside the file ({str(image.get('uri', ''))[:40]!r})",
            "images embedded in the .glb",
        )
    pixels = decode_image(read_view(document, image["bufferView"]), MAX_TEXTURE_PIXELS)
    samplers = document.json.get("samplers", [])
    sampler = samplers[texture["sampler"]] if "sampler" in texture else {}
    return Texture(
        pixels,
        _WRAP.get(sampler.get("wrapS", 10497), Wrap.REPEAT),
        _WRAP.get(sampler.get("wrapT", 10497), Wrap.REPEAT),
    )
