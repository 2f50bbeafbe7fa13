"""Outdoor plants: trees, shrubs and climbers made of many small leaves."""

import numpy as np

from dfvs_core.geometry.arrays import FloatArray
from dfvs_rooms.generator.solids import Part, disc, lathe, quad_triangles, tube


def leaves(
    rng: np.random.Generator, places: FloatArray, outwards: FloatArray, material: str, size_m: float
) -> Part:
    """One small leaf at each place (N, 3), facing roughly along ``outwards`` (N, 3)."""
    count = len(places)
    normal = outwards + 0.7 * rng.normal(size=(count, 3))
    normal /= np.linalg.norm(normal, axis=1, keepdims=True)
    along = np.cross(normal, rng.normal(size=(count, 3)))
    along /= np.linalg.norm(along, axis=1, keepdims=True)
    across = np.cross(normal, along)
    scale = size_m * rng.uniform(0.7, 1.3, (count, 1))
    corners = [
        places + scale * (0.5 * v * along + 0.32 * u * across)
        for u, v in ((-1, -1), (1, -1), (-1, 1), (1, 1))
    ]
    uv = np.tile([[0.25, 0.9], [0.75, 0.9], [0.25, 0.1], [0.75, 0.1]], (count, 1))
    vertices = np.stack(corners, axis=1).reshape(-1, 3)
    light = outwards / np.linalg.norm(outwards, axis=1, keepdims=True)
    normals = np.repeat(0.6 * light + 0.4 * normal, 4, axis=0)
    normals /= np.linalg.norm(normals, axis=1, keepdims=True)
    return Part(vertices, normals, uv, quad_triangles(count), material, is_sheet=True)


def crown(
    rng: np.random.Generator,
    centre: tuple[float, float, float],
    size: tuple[float, float, float],
    count: int,
    material: str,
) -> list[Part]:
    """Bushy ellipsoid of (width, depth, height) around a centre, dense at its outside."""
    way = rng.normal(size=(count, 3))
    way /= np.linalg.norm(way, axis=1, keepdims=True)
    bumps = 1.0 + 0.16 * np.sin(4 * way[:, :1] * 3 + 2.0) * np.sin(5 * way[:, 1:2] * 2.4)
    reach = rng.uniform(0.72, 1.0, (count, 1)) ** 0.5 * bumps
    half = 0.5 * np.array(size)
    places = np.array(centre) + reach * way * half
    return [leaves(rng, places, way / half, material, 0.1)]


def shrub(rng: np.random.Generator, width: float, height: float, material: str) -> list[Part]:
    """Round shrub that stands at the origin."""
    count = int(650 * width * height)
    return crown(rng, (0, 0, 0.55 * height), (width, width, 0.95 * height), count, material)


def tree(rng: np.random.Generator, height: float, material: str) -> list[Part]:
    """Small tree with a forked trunk."""
    fork = 0.45 * height
    parts = [tube((0, 0, 0), (0.02, 0, fork), (0.075, 0.055), "bark", sides=12, edge_m=0.12)]
    for k in range(4):
        angle = 1.57 * k + float(rng.uniform(-0.4, 0.4))
        reach = 0.2 * height
        end = (reach * np.cos(angle), reach * np.sin(angle), 0.78 * height)
        parts.append(tube((0.02, 0, fork - 0.05), end, (0.045, 0.015), "bark", sides=8))
        size = (0.42 * height, 0.42 * height, 0.36 * height)
        parts += crown(rng, (0.9 * end[0], 0.9 * end[1], 0.8 * height), size, 420, material)
    return parts


def tub(rng: np.random.Generator, radius: float, clay: str, leaf: str) -> list[Part]:
    """Clay tub with a clipped ball of leaves on a stem."""
    height = 1.6 * radius
    profile = [(0.7 * radius, 0.0), (0.8 * radius, 0.3 * height), (radius, 0.85 * height)]
    profile += [(1.08 * radius, 0.86 * height), (1.08 * radius, height), (0.9 * radius, height)]
    parts = [lathe(profile, clay, sides=26), disc(0.92 * radius, (0, 0, 0.93 * height), "earth")]
    top = height + float(rng.uniform(0.3, 0.6))
    parts.append(tube((0, 0, height * 0.9), (0, 0, top), 0.02, "bark", sides=8))
    ball = 2.2 * radius
    return parts + crown(rng, (0, 0, top + 0.35 * ball), (ball, ball, ball), 420, leaf)


def climber(
    rng: np.random.Generator, width: float, height: float, count: int, leaf: str
) -> list[Part]:
    """Leaves on a wall at y = 0, its lower middle at the origin, thinning out upwards."""
    s, t = rng.normal(0.0, 0.32, count), rng.beta(1.1, 1.6, count)
    edge = 0.5 * width * (1.0 - 0.5 * t)
    places = np.stack([s * edge * 1.6, -rng.uniform(0.02, 0.14, count), t * height], 1)
    outwards = np.tile([0.0, -1.0, 0.35], (count, 1))
    return [leaves(rng, places, outwards, leaf, 0.11)]
