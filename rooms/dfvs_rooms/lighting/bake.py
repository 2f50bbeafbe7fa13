"""A room with its light baked into the vertices: fill, smooth, expose, and join as a scene."""

import numpy as np

from dfvs_core.geometry.arrays import Float32Array, FloatArray
from dfvs_rooms.generator.room import Room
from dfvs_rooms.generator.solids import Part, merged
from dfvs_rooms.lighting.fast import ROUGH, LightPoints, fast_irradiance
from dfvs_rooms.lighting.path_traced import BakeSettings, Progress, measure_irradiance
from dfvs_sim.scene.frames import ned_from_room
from dfvs_sim.scene.mesh import Int32Array, Scene
from dfvs_sim.scene.texture import Texture

_WHITE_BALANCE = 0.7
_WHITE_POINT = 6.0
_MIDDLE_LIGHT, _MIDDLE_LIGHT_OUTDOORS = 0.5, 0.32
_NO_LIGHT = 1e-6
_SMOOTHING_ROUNDS, _SMOOTHING_CONTRAST = 5, 0.10


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
    """Join a room into one mesh in NED, by the irradiance (N, 3) of each part's vertices."""
    parts = list(room.parts)
    light = [
        smoothed(part, filled(part, value)) for part, value in zip(parts, irradiance, strict=True)
    ]
    names = list(room.materials)
    vertices, triangles = merged(parts)
    uv = [p.uv / room.materials[p.material].span_m for p in parts]
    textures = [np.full(len(p.triangles), names.index(p.material), np.int32) for p in parts]
    return Scene(
        vertices=ned_from_room(vertices).astype(np.float32),
        triangles=triangles,
        uv=np.concatenate([u - np.floor(u.min(axis=0)) for u in uv]).astype(np.float32),
        colours=np.concatenate(exposed(room, light)),
        texture_index=np.concatenate(textures),
        textures=tuple(Texture(m.image) for m in room.materials.values()),
    )


def filled(part: Part, irradiance: FloatArray) -> FloatArray:
    """Give vertices that lie inside other things the light of their neighbours."""
    value = irradiance.copy()
    dark = value.sum(axis=1) < _NO_LIGHT
    edges = _edges(part)
    for _ in range(3):
        if not dark.any() or dark.all():
            break
        useful = dark[edges[:, 0]] & ~dark[edges[:, 1]]
        total, count = np.zeros_like(value), np.zeros(len(value))
        np.add.at(total, edges[useful, 0], value[edges[useful, 1]])
        np.add.at(count, edges[useful, 0], 1.0)
        found = count > 0
        value[found] = total[found] / count[found, None]
        dark = dark & ~found
    return value


def _edges(part: Part) -> Int32Array:
    """Pairs (E, 2) of neighbouring vertices, each both ways."""
    edges = np.concatenate([part.triangles[:, [a, b]] for a, b in ((0, 1), (1, 2), (2, 0))])
    return np.concatenate([edges, edges[:, ::-1]])


def smoothed(part: Part, irradiance: FloatArray) -> FloatArray:
    """Take out the sampler's noise, but not the edges of shadows."""
    value, edges = irradiance, _edges(part)
    a, b = edges.T
    for _ in range(_SMOOTHING_ROUNDS):
        level = value.sum(axis=1)
        contrast = (level[a] - level[b]) / np.maximum(level[a] + level[b], 1e-9)
        weight = np.exp(-((contrast / _SMOOTHING_CONTRAST) ** 2))[:, None]
        total, count = value.copy(), np.ones((len(value), 1))
        np.add.at(total, a, 0.5 * weight * value[b])
        np.add.at(count, a, 0.5 * weight)
        value = total / count
    return value


def _usual_light(room: Room, irradiance: list[FloatArray]) -> FloatArray:
    """Median light (3,) of the walls where any falls on them: none does behind what hides them."""
    pairs = zip(room.parts, irradiance, strict=True)
    walls = [value for part, value in pairs if part.material in room.walls] or irradiance
    values = np.concatenate(walls)
    lit = values[values.sum(axis=1) > _NO_LIGHT]
    return np.maximum(np.median(lit if len(lit) else values, axis=0), _NO_LIGHT)


def exposed(room: Room, irradiance: list[FloatArray]) -> list[Float32Array]:
    """Take irradiance to vertex colours in 0 to 1, with a soft shoulder in the bright parts."""
    usual = _usual_light(room, irradiance)
    gain = (usual.mean() / usual) ** _WHITE_BALANCE
    middle = _MIDDLE_LIGHT if room.sky is None else _MIDDLE_LIGHT_OUTDOORS
    exposure = middle / float(usual.mean()) * gain
    colours = []
    for part, value in zip(room.parts, irradiance, strict=True):
        if room.materials[part.material].shines:
            tint = (1.0, 0.92, 0.78) if part.emission > 0 else (1.0, 1.0, 1.0)
            colours.append(np.tile(np.array(tint, np.float32), (len(value), 1)))
            continue
        light = exposure * value
        peak = np.maximum(light.max(axis=1, keepdims=True), 1e-9)
        shoulder = (1.0 + peak / _WHITE_POINT**2) / (1.0 + 0.55 * peak)
        colours.append(np.clip(light * shoulder, 0.0, 1.0).astype(np.float32))
    return colours
