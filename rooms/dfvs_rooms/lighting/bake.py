"""A room with its light baked into the vertices, as a scene to render."""

import numpy as np

from dfvs_core.geometry.arrays import Float32Array, FloatArray
from dfvs_rooms.generator.room import Room
from dfvs_rooms.generator.solids import merged
from dfvs_rooms.lighting.exposure import exposed, filled, smoothed
from dfvs_rooms.lighting.fast import ROUGH, LightPoints, fast_irradiance
from dfvs_rooms.lighting.path_traced import BakeSettings, Progress, measure_irradiance
from dfvs_sim.scene.frames import ned_from_room
from dfvs_sim.scene.mesh import Scene
from dfvs_sim.scene.texture import Texture


def bake_room(room: Room, settings: BakeSettings, progress: Progress) -> Scene:
    """Compute the light of a room and return it as a scene.

    Raises
    ------
    BakeError
        If Mitsuba is not installed.
    """
    return lit_scene(room, measure_irradiance(room, settings, progress))


def light_room(room: Room, seed: int, count: LightPoints = ROUGH) -> Scene:
    """Light a room within seconds, roughly, and return it as a scene; no Mitsuba needed."""
    return lit_scene(room, fast_irradiance(room, seed, count))


def lit_scene(room: Room, irradiance: list[FloatArray]) -> Scene:
    """Turn a room and the irradiance (N, 3) of each part's vertices into a scene."""
    pairs = zip(room.parts, irradiance, strict=True)
    light = [smoothed(part, filled(part, value)) for part, value in pairs]
    return _scene(room, exposed(room, light))


def _scene(room: Room, colours: list[Float32Array]) -> Scene:
    """Join all parts into one mesh in NED."""
    names = list(room.materials)
    parts = list(room.parts)
    vertices, triangles = merged(parts)
    uv = [p.uv / room.materials[p.material].span_m for p in parts]
    textures = [np.full(len(p.triangles), names.index(p.material), np.int32) for p in parts]
    return Scene(
        vertices=ned_from_room(vertices).astype(np.float32),
        triangles=triangles,
        uv=np.concatenate([u - np.floor(u.min(axis=0)) for u in uv]).astype(np.float32),
        colours=np.concatenate(colours),
        texture_index=np.concatenate(textures),
        textures=tuple(Texture(m.image) for m in room.materials.values()),
    )
