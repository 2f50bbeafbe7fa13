"""Light on a room's vertices in seconds: lamps, skylight and one bounce, with shadow maps.

Instant radiosity (Keller, SIGGRAPH 1997). Direct light comes from points on the lamps and in the
windows. Points on the surfaces that it reaches, drawn in proportion to what they reflect, become
lamps of their own; what bounces further is taken as even and added as a geometric series. What a
point cannot reach is told by the renderer's depth in the six directions around it. Shadows are
true to a few centimetres; ``path_traced.py`` traces paths instead and takes minutes.
"""

from dataclasses import dataclass

import numpy as np

from dfvs_core.geometry.arrays import BoolArray, FloatArray
from dfvs_core.geometry.camera import CameraModel
from dfvs_core.geometry.poses import make_pose
from dfvs_rooms.generator.room import Opening, Room
from dfvs_rooms.generator.solids import Part, merged
from dfvs_rooms.lighting.daylight import sky_irradiance
from dfvs_rooms.lighting.path_traced import LAMP_RADIANCE, SKY_RADIANCE, mean_albedo
from dfvs_rooms.lighting.vertices import at_all_parts, lit_parts, means_of_sides, side_points
from dfvs_sim.render.renderer import Renderer
from dfvs_sim.scene.frames import ned_from_room
from dfvs_sim.scene.mesh import NO_TEXTURE, Scene
from dfvs_sim.viewpoints.free_space import CUBE_FACES

_MAP_SIDE_PX = 128
_MAP_CAMERA = CameraModel.from_horizontal_fov(_MAP_SIDE_PX, _MAP_SIDE_PX, 0.5 * np.pi)
_LIFT_M, _NEAREST_M = 0.012, 0.35
_DARKEST_SLOPE = 0.15


@dataclass(frozen=True, slots=True)
class LightPoints:
    """By how many points the light is told: the more, the smoother and the slower."""

    per_opening: int = 6
    """Points of sky in each window."""
    bounce: int = 56
    """Points on surfaces that send on what falls on them."""


ROUGH, FINE = LightPoints(), LightPoints(16, 150)


@dataclass(frozen=True, slots=True, eq=False)
class _Source:
    """A point that shines, in NED: intensity (3,) W/sr along ``facing`` (3,), or all around."""

    place: FloatArray
    intensity: FloatArray
    facing: FloatArray | None


@dataclass(frozen=True, slots=True, eq=False)
class _Surface:
    """Everything that light falls on, in NED, as points (N, 3) with unit normals (N, 3).

    ``blockers`` draws it as what stands in the way of light.
    """

    parts: list[Part]
    points: FloatArray
    normals: FloatArray
    blockers: Renderer


def fast_irradiance(room: Room, seed: int, count: LightPoints = ROUGH) -> list[FloatArray]:
    """Irradiance (N, 3) at the vertices of each of a room's parts; as ``measure_irradiance``.

    Sheets get the mean of both sides, things that shine nothing.
    """
    rng = np.random.default_rng([seed, 2])
    surface = _surface(room)
    lamps = [p for p in room.parts if p.emission > 0]
    direct = np.zeros_like(surface.points)
    for source in _lamp_points(lamps, rng) + _sky_points(room.openings, count, rng):
        direct += _light(source, surface)
    if room.sky is not None:
        place = (surface.points, surface.normals)
        direct += sky_irradiance(room.sky, *place, surface.blockers, rng)
    bounced = np.zeros_like(surface.points)
    albedo, sources = _bounce_points(room, surface, direct, count, rng)
    for source in sources:
        bounced += _light(source, surface)
    total = direct + bounced / (1.0 - np.minimum(albedo, 0.7))
    return at_all_parts(room, total)


def _surface(room: Room) -> _Surface:
    """Points just above the vertices of all that does not shine, every side of every part."""
    parts = lit_parts(room)
    points, normals = side_points(parts)
    lifted = ned_from_room(points + _LIFT_M * normals)
    return _Surface(parts, lifted, ned_from_room(normals), blockers(parts))


def _lamp_points(lamps: list[Part], rng: np.random.Generator) -> list[_Source]:
    """Points in shining balls: one of radiance L and radius r has the intensity pi r^2 L."""
    sources = []
    for lamp in lamps:
        low, high = lamp.vertices.min(axis=0), lamp.vertices.max(axis=0)
        centre, radius = 0.5 * (low + high), 0.98 * 0.5 * float((high - low).max())
        power = np.pi * radius**2 * lamp.emission * np.array(LAMP_RADIANCE)
        directions = _even_directions(rng)
        for way in directions:
            place = ned_from_room(centre + 0.7 * radius * way)
            sources.append(_Source(place, power / len(directions), None))
    return sources


def _even_directions(rng: np.random.Generator) -> FloatArray:
    """Unit vectors (4, 3) to the corners of a tetrahedron that is turned anyhow."""
    R, _ = np.linalg.qr(rng.normal(size=(3, 3)))
    corners = np.array([[1, 1, 1], [1, -1, -1], [-1, 1, -1], [-1, -1, 1]]) / np.sqrt(3.0)
    return np.asarray(corners @ R, np.float64)


def _sky_points(
    openings: tuple[Opening, ...], count: LightPoints, rng: np.random.Generator
) -> list[_Source]:
    """Points in the windows: an area A of radiance L has the intensity A L along its normal."""
    sources = []
    for sky in openings:
        width, height = sky.size_m
        n = count.per_opening
        power = width * height * np.array(SKY_RADIANCE) / n
        columns = np.arange(n) + rng.random(n)
        s = (columns / n - 0.5) * width
        z = (rng.permutation(columns) / n - 0.5) * height
        for across, up in zip(s, z, strict=True):
            place = np.array(sky.middle_m) + across * sky.across + [0.0, 0.0, up]
            facing = ned_from_room(sky.inwards)
            sources.append(_Source(ned_from_room(place), power, facing))
    return sources


def _bounce_points(
    room: Room,
    surface: _Surface,
    direct: FloatArray,
    count: LightPoints,
    rng: np.random.Generator,
) -> tuple[FloatArray, list[_Source]]:
    """Mean reflectance (3,) of a room, and points that send on the direct light (N, 3)."""
    parts = surface.parts
    vertices, triangles = merged(parts)
    normals = np.concatenate([p.normals for p in parts])
    light = np.concatenate(means_of_sides(parts, direct))[triangles].mean(axis=1)
    counts = [len(p.triangles) for p in parts]
    albedo = np.repeat([mean_albedo(room.materials[p.material]) for p in parts], counts, axis=0)
    a, b, c = (vertices[triangles[:, k]] for k in range(3))
    area = 0.5 * np.linalg.norm(np.cross(b - a, c - a), axis=1)
    flux = light * albedo * area[:, None]
    weight = flux.sum(axis=1)
    mean = np.asarray((albedo * area[:, None]).sum(axis=0) / area.sum(), np.float64)
    if weight.sum() <= 0:
        return mean, []
    steps = (np.arange(count.bounce) + rng.random(count.bounce)) / count.bounce
    chosen = np.searchsorted(np.cumsum(weight) / weight.sum(), steps).clip(max=len(weight) - 1)
    sources = []
    for k in chosen:
        normal = normals[triangles[k]].mean(axis=0)
        at = (a[k] + b[k] + c[k]) / 3 + 2 * _LIFT_M * normal
        power = flux[k] / weight[k] * weight.sum() / count.bounce / np.pi
        sources.append(_Source(ned_from_room(at), power, ned_from_room(normal)))
    return mean, sources


def _light(source: _Source, surface: _Surface) -> FloatArray:
    """Irradiance (N, 3) of a source at a surface's points."""
    way = surface.points - source.place
    distance2 = np.einsum("nk,nk->n", way, way)
    distance = np.sqrt(np.maximum(distance2, 1e-12))
    slope = -np.einsum("nk,nk->n", way, surface.normals) / distance
    strength = slope / np.maximum(distance2, _NEAREST_M**2)
    if source.facing is not None:
        strength *= (way @ source.facing) / distance
        slope = np.where(way @ source.facing > 0, slope, 0.0)
    lit = np.flatnonzero(slope > 0)
    lit = lit[_reached(surface.blockers, source.place, way[lit], slope[lit])]
    result = np.zeros_like(surface.points)
    result[lit] = strength[lit, None] * source.intensity
    return result


def _reached(
    blockers: Renderer, place: FloatArray, way: FloatArray, slope: FloatArray
) -> BoolArray:
    """Tell which points, at ``way`` (N, 3) from a place, are not hidden from it."""
    axis = np.abs(way).argmax(axis=1)
    face = 2 * axis + (np.take_along_axis(way, axis[:, None], 1)[:, 0] < 0)
    reached = np.zeros(len(way), np.bool_)
    for k in np.unique(face):
        here = face == k
        R = CUBE_FACES[k]
        seen = way[here] @ R
        depth = blockers.depth(_MAP_CAMERA, make_pose(R, place))
        i, j = _MAP_CAMERA.project(seen).T.astype(np.intp).clip(0, _MAP_SIDE_PX - 1)
        steep = np.sqrt(1 - slope[here] ** 2) / np.maximum(slope[here], _DARKEST_SLOPE)
        reach = seen[:, 2] * (1.0 - 1.5 / _MAP_SIDE_PX * steep) - 0.01
        blocker = depth[j, i]
        reached[here] = (blocker == 0.0) | (reach <= blocker)
    return reached


def blockers(parts: list[Part]) -> Renderer:
    """Depth of plain parts, by which they stand in the way of light."""
    vertices, triangles = merged(parts)
    n = len(vertices)
    return Renderer(
        Scene(
            vertices=ned_from_room(vertices).astype(np.float32),
            triangles=triangles,
            uv=np.zeros((n, 2), np.float32),
            colours=np.ones((n, 3), np.float32),
            texture_index=np.full(len(triangles), NO_TEXTURE, np.int32),
        )
    )
