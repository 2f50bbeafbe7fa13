"""Shapes that a room is furnished with: meshes with normals and texture coordinates.

Room axes are x east, y north, z up, in m, with the origin on the floor in the middle of the room.
Texture coordinates of solids are metres along the surface: a material says how many metres its
image spans. Those of stretched textures run from 0 to 1.
"""

from __future__ import annotations

import functools
from collections.abc import Iterable, Sequence
from dataclasses import dataclass, replace

import numpy as np

from dfvs_core.geometry.arrays import FloatArray
from dfvs_sim.scene.mesh import Int32Array

EDGE_M = 0.09
"""Longest edge of furniture: light is stored per vertex, so shadows need edges."""


@dataclass(frozen=True, slots=True, eq=False)
class Part:
    """A piece of mesh of one material."""

    vertices: FloatArray
    normals: FloatArray
    """Both (N, 3) float64: positions in room axes, m, and outward unit normals."""
    uv: FloatArray
    """(N, 2) float64: texture coordinates, m (or 0 to 1 where stretched)."""
    triangles: Int32Array
    """(M, 3) int32: vertex indices, anticlockwise seen from outside."""
    material: str
    """Name of the material."""
    is_sheet: bool = False
    """Thin: lit and seen from both sides."""
    emission: float = 0.0
    """Light given off, relative to a lit white wall; 0 for things that do not shine."""

    def moved(self, x: float, y: float, z: float = 0.0, turn_deg: float = 0.0) -> Part:
        """Turn anticlockwise about the vertical axis, then shift."""
        c, s = np.cos(np.radians(turn_deg)), np.sin(np.radians(turn_deg))
        R = np.array([[c, -s, 0.0], [s, c, 0.0], [0.0, 0.0, 1.0]])
        return replace(self, vertices=self.vertices @ R.T + [x, y, z], normals=self.normals @ R.T)


def placed(
    parts: Iterable[Part], x: float, y: float, z: float = 0.0, turn_deg: float = 0.0
) -> list[Part]:
    """Turn and shift several parts together, as one piece of furniture."""
    return [part.moved(x, y, z, turn_deg) for part in parts]


def joined(parts: Iterable[Part]) -> list[Part]:
    """Same meshes with all parts of one material, that do not shine, as one part each."""
    groups: dict[tuple[str, bool, float, int], list[Part]] = {}
    for k, part in enumerate(parts):
        own = k + 1 if part.emission > 0 else 0
        groups.setdefault((part.material, part.is_sheet, part.emission, own), []).append(part)
    return [as_one(group) for group in groups.values()]


def as_one(parts: Sequence[Part]) -> Part:
    """Several parts of the first one's material as one mesh."""
    vertices, triangles = merged(parts)
    normals = np.concatenate([part.normals for part in parts])
    uv = np.concatenate([part.uv for part in parts])
    return replace(parts[0], vertices=vertices, normals=normals, uv=uv, triangles=triangles)


def merged(parts: Sequence[Part]) -> tuple[FloatArray, Int32Array]:
    """Vertices and triangles of several parts as one mesh."""
    first = np.cumsum([0] + [len(p.vertices) for p in parts[:-1]])
    triangles = [p.triangles + n for p, n in zip(parts, first, strict=True)]
    return np.concatenate([p.vertices for p in parts]), np.concatenate(triangles).astype(np.int32)


def tilted(part: Part, axis: Sequence[float], angle_deg: float) -> Part:
    """Turn a part about an axis (3,) through the origin."""
    a = np.asarray(axis, dtype=np.float64) / np.linalg.norm(axis)
    angle = np.radians(angle_deg)
    K = np.array([[0, -a[2], a[1]], [a[2], 0, -a[0]], [-a[1], a[0], 0]])
    R = np.eye(3) + np.sin(angle) * K + (1 - np.cos(angle)) * K @ K
    return replace(part, vertices=part.vertices @ R.T, normals=part.normals @ R.T)


def steps(low: float, high: float, edge_m: float) -> FloatArray:
    """Positions from low to high, at most edge_m apart."""
    return np.linspace(low, high, max(1, int(np.ceil((high - low) / edge_m - 1e-6))) + 1)


def corners(x: float, y: float) -> list[tuple[float, float]]:
    """Four places (-x or x, -y or y), as of legs."""
    return [(i * x, j * y) for i in (-1, 1) for j in (-1, 1)]


@functools.lru_cache(maxsize=1024)
def grid_triangles(rows: int, columns: int) -> Int32Array:
    """Triangles of a grid of rows x columns vertices, with alternating diagonals; read-only."""
    j, i = np.meshgrid(np.arange(rows - 1), np.arange(columns - 1), indexing="ij")
    a = (j * columns + i).ravel()
    b, c, d = a + 1, a + columns, a + columns + 1
    even = ((i + j) % 2 == 0).ravel()
    first = np.where(even[:, None], np.stack([a, b, d], 1), np.stack([a, b, c], 1))
    second = np.where(even[:, None], np.stack([a, d, c], 1), np.stack([b, d, c], 1))
    triangles = np.concatenate([first, second]).astype(np.int32)
    triangles.flags.writeable = False  # it is kept: most panels of a room have few sizes
    return triangles


def quad_triangles(count: int) -> Int32Array:
    """Triangles of quads that share no vertex: lower left, lower right, upper left, upper right."""
    quad = np.array([[0, 1, 3], [0, 3, 2]], np.int32)
    return (quad + 4 * np.arange(count)[:, None, None]).reshape(-1, 3).astype(np.int32)


def sheet(points: FloatArray, uv: FloatArray, material: str, *, is_sheet: bool = True) -> Part:
    """Smooth surface through a grid of points (rows, columns, 3), uv (rows, columns, 2).

    The normal is (along columns) x (along rows).
    """
    rows, columns = points.shape[:2]
    across, along = np.gradient(points, axis=1), np.gradient(points, axis=0)
    normals = np.cross(across, along).reshape(-1, 3)
    length = np.linalg.norm(normals, axis=1, keepdims=True)
    return Part(
        points.reshape(-1, 3),
        normals / np.maximum(length, 1e-12),
        uv.reshape(-1, 2),
        grid_triangles(rows, columns),
        material,
        is_sheet,
    )


def panel(  # noqa: PLR0913
    origin: Sequence[float],
    across: Sequence[float],
    up: Sequence[float],
    material: str,
    *,
    edge_m: float = EDGE_M,
    stretched: bool = False,
) -> Part:
    """Flat rectangle from its lower left corner, seen from the side where across is right.

    ``stretched`` lays the texture over it once, its first row on top.
    """
    o, a, b = (np.asarray(v, dtype=np.float64) for v in (origin, across, up))
    width, height = float(np.linalg.norm(a)), float(np.linalg.norm(b))
    u, v = steps(0.0, width, edge_m), steps(0.0, height, edge_m)
    gu, gv = np.meshgrid(u, v)
    points = o + gu[..., None] * a / width + gv[..., None] * b / height
    uv = np.stack([gu / width, 1.0 - gv / height], -1) if stretched else np.stack([gu, -gv], -1)
    return sheet(points, uv, material, is_sheet=False)


def box(
    size: Sequence[float],
    base: Sequence[float],
    material: str,
    *,
    edge_m: float = EDGE_M,
    skip: str = "",
) -> list[Part]:
    """Box of size (3,) standing with the middle of its bottom at base (3,).

    ``skip`` names the faces left out, of "-x +x -y +y -z +z".
    """
    sx, sy, sz = size
    x0, y0, z0 = base[0] - sx / 2, base[1] - sy / 2, base[2]
    x1, y1, z1 = x0 + sx, y0 + sy, z0 + sz
    faces = {
        "-y": ((x0, y0, z0), (sx, 0, 0), (0, 0, sz)),
        "+y": ((x1, y1, z0), (-sx, 0, 0), (0, 0, sz)),
        "+x": ((x1, y0, z0), (0, sy, 0), (0, 0, sz)),
        "-x": ((x0, y1, z0), (0, -sy, 0), (0, 0, sz)),
        "+z": ((x0, y0, z1), (sx, 0, 0), (0, sy, 0)),
        "-z": ((x0, y1, z0), (sx, 0, 0), (0, -sy, 0)),
    }
    left_out = skip.split()
    return [
        panel(*corner, material, edge_m=edge_m)
        for name, corner in faces.items()
        if name not in left_out
    ]


def cushion(
    size: Sequence[float],
    base: Sequence[float],
    material: str,
    *,
    power: float = 5.0,
    edge_m: float = EDGE_M,
) -> list[Part]:
    """Rounded box |x/a|^p + |y/b|^p + |z/c|^p = 1; the larger the power, the sharper the edges."""
    half = np.asarray(size, dtype=np.float64) / 2
    centre = np.asarray(base, dtype=np.float64) + np.array([0.0, 0.0, half[2]])
    parts = []
    for part in box(list(2.0 * half), (0.0, 0.0, -half[2]), material, edge_m=edge_m):
        q = part.vertices / half
        q = np.sign(q) * np.sin(np.abs(q) * np.pi / 4) / np.sin(np.pi / 4)
        q = q / np.sum(np.abs(q) ** power, axis=1, keepdims=True) ** (1.0 / power)
        n = np.sign(q) * np.abs(q) ** (power - 1.0) / half
        n = n / np.linalg.norm(n, axis=1, keepdims=True)
        parts.append(replace(part, vertices=q * half + centre, normals=n))
    return parts


def lathe(
    profile: Sequence[tuple[float, float]],
    material: str,
    *,
    sides: int = 20,
    is_sheet: bool = False,
) -> Part:
    """Surface of revolution about z through (radius, height) points, listed from the bottom up."""
    r, z = np.array(profile, dtype=np.float64).T
    angle = np.linspace(0.0, 2.0 * np.pi, sides + 1)

    def around(radius: FloatArray, height: FloatArray) -> FloatArray:
        x, y = radius[:, None] * np.cos(angle), radius[:, None] * np.sin(angle)
        return np.stack([x, y, np.broadcast_to(height[:, None], x.shape)], -1)

    points = around(r, z)
    points[:, -1] = points[:, 0]
    length = np.concatenate([[0.0], np.cumsum(np.hypot(np.diff(r), np.diff(z)))])
    uv = np.stack(np.broadcast_arrays(angle * r.max(), -length[:, None]), axis=-1)
    part = sheet(points, uv, material, is_sheet=is_sheet)
    slope_r, slope_z = np.gradient(r, length), np.gradient(z, length)
    normals = around(slope_z, -slope_r).reshape(-1, 3)
    normals /= np.maximum(np.linalg.norm(normals, axis=1, keepdims=True), 1e-12)
    return replace(part, normals=normals)


def tube(  # noqa: PLR0913
    start: Sequence[float],
    end: Sequence[float],
    radius: float | tuple[float, float],
    material: str,
    *,
    sides: int = 10,
    edge_m: float = 0.15,
) -> Part:
    """Rod from start to end (3,), open at its ends; two radii make it taper."""
    a, b = np.asarray(start, dtype=np.float64), np.asarray(end, dtype=np.float64)
    axis = b - a
    length = float(np.linalg.norm(axis))
    r0, r1 = (radius, radius) if isinstance(radius, int | float) else radius
    s = steps(0.0, length, edge_m)
    part = lathe([(r0 + (r1 - r0) * t / length, t) for t in s], material, sides=sides)
    w = axis / length
    u = np.cross(w, [1.0, 0.0, 0.0] if abs(w[0]) < 0.9 else [0.0, 1.0, 0.0])
    u /= np.linalg.norm(u)
    R = np.stack([u, np.cross(w, u), w], axis=1)
    return replace(part, vertices=part.vertices @ R.T + a, normals=part.normals @ R.T)


def sphere(radius: float, centre: Sequence[float], material: str, *, sides: int = 20) -> Part:
    """Ball."""
    latitude = np.linspace(-np.pi / 2, np.pi / 2, sides // 2 + 1)
    part = lathe(
        [(radius * np.cos(t), radius * np.sin(t)) for t in latitude], material, sides=sides
    )
    n = part.vertices / radius
    return replace(part, vertices=part.vertices + np.asarray(centre, dtype=np.float64), normals=n)


def disc(radius: float, centre: Sequence[float], material: str, *, sides: int = 24) -> Part:
    """Flat round plate that looks up."""
    radii = steps(0.0, radius, EDGE_M)[::-1]
    part = lathe([(max(r, 1e-4), 0.0) for r in radii], material, sides=sides)
    up = np.tile([0.0, 0.0, 1.0], (len(part.vertices), 1))
    return replace(
        part,
        vertices=part.vertices + np.asarray(centre, dtype=np.float64),
        normals=up,
        uv=part.vertices[:, :2] * [1.0, -1.0],
    )
