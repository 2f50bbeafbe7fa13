"""Scenes small enough to know by heart what a camera sees in them, and GLB files by hand."""

import json
import struct

import numpy as np

from dfvs_core.geometry.camera import CameraModel
from dfvs_sim.scene.mesh import NO_TEXTURE, Scene
from dfvs_sim.scene.texture import Texture
from dfvs_sim.viewpoints.poses import camera_pose

CAMERA = CameraModel.from_horizontal_fov(80, 60, np.radians(80.0))
NORTHWARD = camera_pose((0.0, 0.0, 0.0), 0.0)
SKY = (0.1, 0.2, 0.3)


def scene_of(corners, colours=None, uv=None, texture=None):
    """Scene of triangles given by their corners (M, 3, 3) in NED, one colour or uv per corner."""
    corners = np.asarray(corners, dtype=np.float32)
    n = len(corners)
    if colours is None:
        colours = np.ones((n, 3, 3))
    uv = np.zeros((n, 3, 2)) if uv is None else uv
    return Scene(
        vertices=corners.reshape(-1, 3),
        triangles=np.arange(3 * n, dtype=np.int32).reshape(-1, 3),
        uv=np.asarray(uv, dtype=np.float32).reshape(-1, 2),
        colours=np.broadcast_to(colours, (n, 3, 3)).astype(np.float32).reshape(-1, 3),
        texture_index=np.full(n, NO_TEXTURE if texture is None else 0, np.int32),
        textures=() if texture is None else (texture,),
        sky=SKY,
    )


def wall(north_m, half_width_m=50.0, half_height_m=50.0):
    """Corners (2, 3, 3) of a wall that faces a camera looking north."""
    w, h, n = half_width_m, half_height_m, north_m
    a, b, c, d = (n, -w, -h), (n, w, -h), (n, w, h), (n, -w, h)
    return np.array([[a, b, c], [a, c, d]])


WALL_UV = np.array([[(0, 0), (1, 0), (1, 1)], [(0, 0), (1, 1), (0, 1)]], dtype=float)
"""Texture coordinates that put a picture upright on a ``wall``."""


def checkerboard(cells, size=64):
    """Black and white texture."""
    j, i = np.mgrid[0:size, 0:size] * cells // size
    return Texture(np.repeat((255 * ((i + j) % 2)).astype(np.uint8)[..., None], 3, axis=2))


def random_triangles(rng, count, spread_m=4.0, size_m=2.0):
    """Corners (count, 3, 3) of triangles all around the origin."""
    middle = rng.uniform(-spread_m, spread_m, (count, 1, 3))
    return middle + rng.uniform(-size_m, size_m, (count, 3, 3))


class GlbFile:
    """A GLB file put together piece by piece, in the file's own terms."""

    def __init__(self):
        self.binary = b""
        self.json = {
            "asset": {"version": "2.0"},
            "scene": 0,
            "scenes": [{"nodes": [0]}],
            "nodes": [{"mesh": 0}],
            "meshes": [{"primitives": []}],
            "bufferViews": [],
            "accessors": [],
            "materials": [],
        }

    def view(self, data, **fields):
        self.binary += b"\0" * (-len(self.binary) % 4)
        at = len(self.binary)
        self.binary += data
        self.json["bufferViews"].append(
            {"buffer": 0, "byteOffset": at, "byteLength": len(data), **fields}
        )
        return len(self.json["bufferViews"]) - 1

    def accessor(self, array, normalized=False):
        array = np.asarray(array)
        kind = {1: "SCALAR", 2: "VEC2", 3: "VEC3", 4: "VEC4"}
        width = 1 if array.ndim == 1 else array.shape[1]
        codes = {"float32": 5126, "uint8": 5121, "uint16": 5123, "uint32": 5125}
        self.json["accessors"].append(
            {
                "bufferView": self.view(array.tobytes()),
                "componentType": codes[array.dtype.name],
                "count": len(array),
                "type": kind[width],
                "normalized": normalized,
            }
        )
        return len(self.json["accessors"]) - 1

    def triangle(self, points=((0, 0, 0), (1, 0, 0), (0, 1, 0)), **fields):
        """Add one unindexed primitive through the points."""
        position = self.accessor(np.array(points, dtype=np.float32))
        attributes = {"POSITION": position, **fields.pop("attributes", {})}
        self.json["meshes"][0]["primitives"].append({"attributes": attributes, **fields})

    def material(self, **pbr):
        self.json["materials"].append({"pbrMetallicRoughness": pbr})
        return len(self.json["materials"]) - 1

    def picture(self, data, **sampler):
        """Embed a PNG or JPEG and return its texture's index."""
        view = self.view(data)
        for name in ("images", "textures", "samplers"):
            self.json.setdefault(name, [])
        self.json["images"].append({"bufferView": view, "mimeType": "image/png"})
        self.json["samplers"].append(sampler)
        last = len(self.json["images"]) - 1
        self.json["textures"].append({"source": last, "sampler": last})
        return last

    def to_bytes(self):
        document = {**self.json, "buffers": [{"byteLength": len(self.binary)}]}
        text = json.dumps(document).encode()
        text += b" " * (-len(text) % 4)
        binary = self.binary + b"\0" * (-len(self.binary) % 4)
        body = struct.pack("<II", len(text), 0x4E4F534A) + text
        body += struct.pack("<II", len(binary), 0x004E4942) + binary
        return struct.pack("<4sII", b"glTF", 2, 12 + len(body)) + body

    def write(self, path):
        path.write_bytes(self.to_bytes())
        return path
