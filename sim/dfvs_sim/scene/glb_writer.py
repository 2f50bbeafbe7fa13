"""Write a scene as a compact glTF binary: quantised positions, 16 bit light, JPEG textures."""

import json
import struct
from pathlib import Path
from typing import Any

import numpy as np

from dfvs_common.atomic_file import write_atomic
from dfvs_core.geometry.arrays import FloatArray
from dfvs_core.messages.image import encode_jpeg
from dfvs_sim.scene.frames import gltf_from_ned
from dfvs_sim.scene.mesh import NO_TEXTURE, Scene
from dfvs_sim.scene.texture import Texture, Wrap

_UNSIGNED_SHORT, _UNSIGNED_INT = 5123, 5125
_TOP = 65535
_WRAP = {Wrap.REPEAT: 10497, Wrap.CLAMP: 33071, Wrap.MIRROR: 33648}


class _Writer:
    """The document and the binary chunk while they grow."""

    def __init__(self) -> None:
        self.binary = bytearray()
        self.json: dict[str, Any] = {
            "asset": {"version": "2.0", "generator": "dfvs"},
            "extensionsUsed": [
                "KHR_materials_unlit",
                "KHR_mesh_quantization",
                "KHR_texture_transform",
            ],
            "extensionsRequired": ["KHR_mesh_quantization"],
            "bufferViews": [],
            "accessors": [],
            "materials": [],
            "images": [],
            "textures": [],
            "samplers": [],
        }

    def view(self, data: bytes, **fields: int) -> int:
        """Append bytes as a buffer view and return its index."""
        first = len(self.binary)
        self.binary += data + b"\0" * (-len(data) % 4)
        self.json["bufferViews"].append(
            {"buffer": 0, "byteOffset": first, "byteLength": len(data), **fields}
        )
        return len(self.json["bufferViews"]) - 1

    def accessor(self, view: int, count: int, kind: str, component: int, **fields: Any) -> int:
        """Describe a view's values and return the accessor's index."""
        self.json["accessors"].append(
            {"bufferView": view, "componentType": component, "count": count, "type": kind, **fields}
        )
        return len(self.json["accessors"]) - 1

    def shorts(self, values: Any, kind: str, **fields: Any) -> int:
        """Write vertex values (N, k) of 0 to 65535 as u16, each vertex padded to 4 bytes."""
        count, width = values.shape
        stride = (2 * width + 3) // 4 * 4
        padded = np.zeros((count, stride // 2), "<u2")
        padded[:, :width] = values
        view = self.view(padded.tobytes(), byteStride=stride, target=34962)
        return self.accessor(view, count, kind, _UNSIGNED_SHORT, **fields)

    def save(self, path: Path) -> None:
        """Put the file together and move it into place."""
        self.json["buffers"] = [{"byteLength": len(self.binary)}]
        text = json.dumps(self.json, separators=(",", ":")).encode()
        text += b" " * (-len(text) % 4)
        chunks = struct.pack("<II", len(text), 0x4E4F534A) + text
        chunks += struct.pack("<II", len(self.binary), 0x004E4942) + bytes(self.binary)
        write_atomic(path, struct.pack("<III", 0x46546C67, 2, 12 + len(chunks)) + chunks)


def save_glb(path: str | Path, scene: Scene, quality: int = 70) -> None:
    """Write a scene; ``load_glb`` gives it back to within 1/65535 of its extent and colours.

    Colours must lie in 0 to 1. Textures become JPEG of the given quality (1 to 100).
    """
    writer = _Writer()
    corners = gltf_from_ned(scene.vertices[np.unique(scene.triangles)].astype(np.float64))
    low = corners.min(axis=0)
    scale = float(np.max(corners.max(axis=0) - low)) or 1.0
    primitives = []
    for number in np.unique(scene.texture_index):
        primitives.append(_primitive(writer, scene, int(number), (low, scale)))
    writer.json["meshes"] = [{"primitives": primitives}]
    node = {"mesh": 0, "translation": low.tolist(), "scale": [scale] * 3}
    writer.json |= {"nodes": [node], "scenes": [{"nodes": [0]}], "scene": 0}
    for texture in scene.textures:
        _add_texture(writer, texture, quality)
    for name in ("images", "textures", "samplers"):
        if not writer.json[name]:
            del writer.json[name]
    writer.save(Path(path))


def _primitive(
    writer: _Writer, scene: Scene, texture: int, box: tuple[FloatArray, float]
) -> dict[str, Any]:
    """Write the triangles of one texture."""
    used, index = np.unique(scene.triangles[scene.texture_index == texture], return_inverse=True)
    low, scale = box
    positions = np.rint((gltf_from_ned(scene.vertices[used]) - low) / scale * _TOP)
    colours = np.rint(np.clip(scene.colours[used], 0.0, 1.0) * _TOP)
    opaque = np.full((len(used), 1), _TOP)
    bounds = {"min": (positions.min(0) / _TOP).tolist(), "max": (positions.max(0) / _TOP).tolist()}
    attributes = {
        "POSITION": writer.shorts(positions, "VEC3", normalized=True, **bounds),
        "COLOR_0": writer.shorts(np.hstack([colours, opaque]), "VEC4", normalized=True),
    }
    pbr: dict[str, Any] = {"metallicFactor": 0.0}
    if texture != NO_TEXTURE:
        uv = scene.uv[used].astype(np.float64)
        origin, span = uv.min(axis=0), np.maximum(np.ptp(uv, axis=0), 1e-6)
        attributes["TEXCOORD_0"] = writer.shorts(
            np.rint((uv - origin) / span * _TOP), "VEC2", normalized=True
        )
        transform = {"offset": origin.tolist(), "scale": span.tolist()}
        pbr["baseColorTexture"] = {
            "index": texture,
            "extensions": {"KHR_texture_transform": transform},
        }
    writer.json["materials"].append(
        {
            "pbrMetallicRoughness": pbr,
            "extensions": {"KHR_materials_unlit": {}},
            "doubleSided": True,
        }
    )
    small = len(used) <= _TOP
    data = index.reshape(-1).astype("<u2" if small else "<u4").tobytes()
    indices = writer.accessor(
        writer.view(data, target=34963),
        index.size,
        "SCALAR",
        _UNSIGNED_SHORT if small else _UNSIGNED_INT,
    )
    material = len(writer.json["materials"]) - 1
    return {"attributes": attributes, "indices": indices, "material": material}


def _add_texture(writer: _Writer, texture: Texture, quality: int) -> None:
    """Embed one image with its sampler."""
    view = writer.view(encode_jpeg(texture.image, quality))
    writer.json["images"].append({"bufferView": view, "mimeType": "image/jpeg"})
    writer.json["samplers"].append(
        {
            "magFilter": 9729,
            "minFilter": 9987,
            "wrapS": _WRAP[texture.wrap_u],
            "wrapT": _WRAP[texture.wrap_v],
        }
    )
    writer.json["textures"].append(
        {"source": len(writer.json["images"]) - 1, "sampler": len(writer.json["samplers"]) - 1}
    )
