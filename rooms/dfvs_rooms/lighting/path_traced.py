"""Irradiance at a room's vertices, by path tracing (Mitsuba 3, extra ``[bake]``).

A white plate of a few millimetres lies on each vertex, and an equal, tiny triangle hovers over it
and looks down. An irradiance meter on the mesh of these triangles maps row k of a one-pixel-wide
film to vertex k. So one ordinary render job measures the light of thousands of vertices. Lamps are
sampled directly at the plates.
"""

import importlib
import tempfile
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from dfvs_core.errors import DfvsError
from dfvs_core.geometry.arrays import Float32Array, FloatArray
from dfvs_rooms.generator.room import Opening, Room, Sky
from dfvs_rooms.generator.solids import Part, merged
from dfvs_rooms.lighting.vertices import at_all_parts, lit_parts, side_points
from dfvs_rooms.surfaces.materials import Material
from dfvs_sim.scene.mesh import Int32Array
from dfvs_sim.scene.texture import linear_from_srgb

Progress = Callable[[int, int], None]
"""Called with vertices done and vertices in all."""

_CHUNK = 2048
_METER_SIZE_M, _METER_HEIGHT_M = 2.5e-4, 1.3e-3
_PLATE_SIZE_M, _PLATE_HEIGHT_M, _PLATE_ALBEDO = 6e-3, 3e-4, 0.8
_SKY_WEIGHT = 0.5
_BOUNCES = 7
"""Longest light path."""
LAMP_RADIANCE = (7.0, 6.2, 4.9)
"""Red, green and blue of a lamp of emission 1."""
SKY_RADIANCE = (8.0, 8.9, 9.9)
"""Red, green and blue of the light in a window's opening."""


class BakeError(DfvsError):
    """Light that cannot be computed."""


@dataclass(frozen=True, slots=True)
class BakeSettings:
    """How finely the light is computed."""

    samples: int = 256
    """Light paths per vertex."""
    seed: int = 0

    def __post_init__(self) -> None:
        """Refuse what Mitsuba would stumble over."""
        if not 1 <= self.samples <= 65536:
            raise BakeError(f"{self.samples} light paths per vertex", "1 to 65536")


def load_mitsuba() -> Any:
    """Mitsuba with its scalar variant, which needs nothing beside its wheel.

    Raises
    ------
    BakeError
        If it is not installed.
    """
    try:
        mi = importlib.import_module("mitsuba")
    except ImportError as error:
        raise BakeError(
            "making a room needs Mitsuba 3", "the extra [bake]", "pip install 'dfvs-lab[bake]'"
        ) from error
    mi.set_variant("scalar_rgb")
    mi.set_log_level(mi.LogLevel.Error)
    return mi


def measure_irradiance(room: Room, settings: BakeSettings, progress: Progress) -> list[FloatArray]:
    """Irradiance (N, 3) at the vertices of each of a room's parts, as it was sampled.

    Sheets get the mean of both sides, things that shine nothing.

    Raises
    ------
    BakeError
        If Mitsuba is not installed.
    """
    mi = load_mitsuba()
    with tempfile.TemporaryDirectory() as folder:
        return _Tracer(mi, room, settings, Path(folder)).measure(progress)


def mean_albedo(material: Material) -> FloatArray:
    """Mean linear reflectance (3,) of a material."""
    light = linear_from_srgb(material.image.astype(np.float32) / 255.0)
    return np.asarray(np.minimum(light.reshape(-1, 3).mean(axis=0), 0.85), dtype=np.float64)


class _Tracer:
    """One room as Mitsuba sees it, and the meters on its vertices."""

    def __init__(self, mi: Any, room: Room, settings: BakeSettings, folder: Path) -> None:
        self._mi, self._settings, self._folder = mi, settings, folder
        integrator = {"type": "path", "max_depth": _BOUNCES, "rr_depth": 5}
        self._things = {"type": "scene", "integrator": integrator}
        self._room, self._lit = room, lit_parts(room)
        for name, material in room.materials.items():
            parts = [p for p in self._lit if p.material == name]
            if parts:
                vertices, triangles = merged(parts)
                mesh = (vertices.astype(np.float32), triangles)
                self._things[name] = self._mesh(name, *mesh, mean_albedo(material))
        self._add_lights([p for p in room.parts if p.emission > 0], room.openings)
        if room.sky is not None:
            self._add_daylight(room.sky)

    def _mesh(
        self, name: str, vertices: Float32Array, triangles: Int32Array, albedo: Any
    ) -> dict[str, Any]:
        path = self._folder / f"{name}.ply"
        write_ply(path, vertices, triangles)
        bsdf = {"type": "twosided", "bsdf": {"type": "diffuse", "reflectance": _rgb(albedo)}}
        return {"type": "ply", "filename": str(path), "face_normals": True, "bsdf": bsdf}

    def _add_lights(self, lamps: list[Part], openings: tuple[Opening, ...]) -> None:
        """Shining balls in the room's lamps, and the sky's light in the windows' openings."""
        for k, lamp in enumerate(lamps):
            centre = lamp.vertices.mean(axis=0)
            radius = float(np.linalg.norm(lamp.vertices - centre, axis=1).max())
            self._things[f"lamp{k}"] = {
                "type": "sphere",
                "center": [float(x) for x in centre],
                "radius": radius * 0.98,
                "emitter": _emitter(np.multiply(LAMP_RADIANCE, lamp.emission), radius),
            }
        transform = self._mi.ScalarTransform4f
        for k, sky in enumerate(openings):
            middle = sky.pane_middle
            towards = transform().look_at(origin=middle, target=middle + sky.inwards, up=[0, 0, 1])
            size = transform().scale([sky.size_m[0] / 2, sky.size_m[1] / 2, 1.0])
            self._things[f"sky{k}"] = {
                "type": "rectangle",
                "to_world": towards @ size,
                "emitter": _emitter(SKY_RADIANCE, _SKY_WEIGHT),
            }

    def _add_daylight(self, sky: Sky) -> None:
        """Even light from all over the sky, and the sun's beam."""
        self._things["daylight"] = {"type": "constant", "radiance": _rgb(sky.radiance)}
        self._things["sun"] = {
            "type": "directional",
            "direction": [float(-x) for x in sky.to_sun],
            "irradiance": _rgb(sky.sun_irradiance),
        }

    def measure(self, progress: Progress) -> list[FloatArray]:
        """Irradiance (N, 3) at the vertices of each part, 0 for what shines by itself."""
        points, normals = side_points(self._lit)
        values = np.empty((len(points), 3))
        for first in range(0, len(points), _CHUNK):
            last = min(first + _CHUNK, len(points))
            meters = self._meters(points[first:last], normals[first:last])
            scene = self._mi.load_dict(self._things | meters)
            image = np.array(self._mi.render(scene, seed=self._settings.seed + first))
            values[first:last] = image.reshape(last - first, 3) / _PLATE_ALBEDO
            progress(last, len(points))
        return at_all_parts(self._room, values)

    def _meters(self, points: FloatArray, normals: FloatArray) -> dict[str, Any]:
        """Plates at points (N, 3) of surfaces with normals (N, 3), and meters that see them."""
        plates = _triangles_at(points + _PLATE_HEIGHT_M * normals, normals, _PLATE_SIZE_M)
        meters = _triangles_at(points + _METER_HEIGHT_M * normals, -normals, _METER_SIZE_M)
        film = {
            "type": "hdrfilm",
            "width": 1,
            "height": len(points),
            "rfilter": {"type": "box"},
            "pixel_format": "rgb",
            "component_format": "float32",
        }
        sampler = {"type": "multijitter", "sample_count": self._settings.samples}
        sensor = {"type": "irradiancemeter", "film": film, "sampler": sampler}
        return {
            "plates": self._mesh("plates", *plates, [_PLATE_ALBEDO] * 3),
            "meters": {**self._mesh("meters", *meters, [0.0] * 3), "sensor": sensor},
        }


def _rgb(value: Any) -> dict[str, Any]:
    return {"type": "rgb", "value": [float(x) for x in value]}


def _emitter(radiance: Any, weight: float) -> dict[str, Any]:
    """Area light; lights of more weight are sampled more often."""
    return {"type": "area", "radiance": _rgb(radiance), "sampling_weight": weight}


def _triangles_at(
    points: FloatArray, normals: FloatArray, radius_m: float
) -> tuple[Float32Array, Int32Array]:
    """Equilateral triangles around points (N, 3), facing along normals (N, 3)."""
    helper = np.where(np.abs(normals[:, :1]) < 0.8, [[1.0, 0.0, 0.0]], [[0.0, 1.0, 0.0]])
    u = np.cross(normals, helper)
    u /= np.linalg.norm(u, axis=1, keepdims=True)
    v = np.cross(normals, u)
    angles = np.radians([0.0, 120.0, 240.0])
    corners = [points + radius_m * (np.cos(a) * u + np.sin(a) * v) for a in angles]
    vertices = np.stack(corners, axis=1).reshape(-1, 3).astype(np.float32)
    return vertices, np.arange(len(vertices), dtype=np.int32).reshape(-1, 3)


def write_ply(path: Path, vertices: Float32Array, triangles: Int32Array) -> None:
    """Write a binary PLY mesh: vertices (N, 3), triangles (M, 3)."""
    header = (
        "ply\nformat binary_little_endian 1.0\n"
        f"element vertex {len(vertices)}\nproperty float x\nproperty float y\nproperty float z\n"
        f"element face {len(triangles)}\nproperty list uchar int vertex_indices\nend_header\n"
    )
    faces = np.empty(len(triangles), dtype=[("n", "u1"), ("v", "<i4", 3)])
    faces["n"], faces["v"] = 3, triangles
    path.write_bytes(header.encode() + vertices.astype("<f4").tobytes() + faces.tobytes())
