"""Bookcases for many books: a book is eight triangles, a shelf of them one mesh."""

from collections.abc import Sequence

import numpy as np

from dfvs_core.geometry.arrays import FloatArray
from dfvs_rooms.generator.solids import Part, box, panel, placed
from dfvs_sim.scene.mesh import Int32Array

_SPINES = 24
_QUAD = np.array([[0, 1, 3], [0, 3, 2]], np.int32)


def bookcase(
    rng: np.random.Generator, size: tuple[float, float, float], wood: str, books: str
) -> list[Part]:
    """Full open bookcase of (width, depth, height), m, its front to -y, standing at the origin."""
    width, depth, height = size
    board = 0.028
    parts: list[Part] = []
    for x in (-1, 1):
        side = (x * (width - board) / 2, 0, 0)
        parts += box((board, depth, height), side, wood, skip="-z", edge_m=0.15)
    back = ((-width / 2, depth / 2 - 0.01, 0.0), (width, 0, 0), (0, 0, height))
    parts.append(panel(*back, wood, edge_m=0.15))
    levels = np.linspace(0.06, height - board, max(3, round(height / 0.36)) + 1)
    inner = width - 2 * board
    for k, z in enumerate(levels):
        shelf = (inner, depth - 0.012, board)
        parts += box(shelf, (0, -0.005, float(z)), wood, skip="-x +x", edge_m=0.15)
        if k + 1 < len(levels):
            room = (inner - 0.02, depth, float(levels[k + 1] - z - board))
            parts += placed([row_of_books(rng, room, books)], 0, 0, float(z) + board)
    return parts


def row_of_books(rng: np.random.Generator, room: tuple[float, float, float], books: str) -> Part:
    """Standing books in a room of (width, depth, height), m, with a gap, as one part."""
    width, depth, height = room
    quads: list[tuple[FloatArray, FloatArray, FloatArray]] = []
    x, gap = -width / 2, float(rng.uniform(-0.9, 0.5)) * width
    base, deep = float(rng.uniform(0.62, 0.8)), float(rng.uniform(0.66, 0.8)) * depth
    while x < width / 2 - 0.05:
        thick = float(rng.uniform(0.018, 0.05))
        tall = min(0.95, base + float(rng.uniform(-0.09, 0.14))) * height
        if not gap < x < gap + 0.12:
            low = (x, depth / 2 - 0.025 - deep - float(rng.uniform(0.0, 0.02)), 0.0)
            quads += _book(low, (thick, deep, tall), int(rng.integers(_SPINES)))
        x += thick + 0.001
    if not quads:
        quads = _book((-0.02, 0.0, 0.0), (0.04, 0.1, 0.7 * height), 0)
    return _of_quads(quads, books)


def _book(
    low: Sequence[float], size: tuple[float, float, float], which: int
) -> list[tuple[FloatArray, FloatArray, FloatArray]]:
    """Spine, top and both sides of a book as (corners, normal, uv)."""
    x0, y0, z0 = low
    x1, y1, z1 = x0 + size[0], y0 + size[1], z0 + size[2]
    left, right = (which + 0.04) / _SPINES, (which + 0.96) / _SPINES
    spine = np.array([[left, 1.0], [right, 1.0], [left, 0.0], [right, 0.0]])
    plain = np.array([[0.0, 0.05], [1.0, 0.05], [0.0, 0.01], [1.0, 0.01]])
    cover = plain * [0.1 / _SPINES, 1.0] + [(which + 0.45) / _SPINES, 0.0]
    faces = (
        ((x0, y0, z0), (x1, y0, z0), (x0, y0, z1), (x1, y0, z1)),
        ((x0, y0, z1), (x1, y0, z1), (x0, y1, z1), (x1, y1, z1)),
        ((x1, y0, z0), (x1, y1, z0), (x1, y0, z1), (x1, y1, z1)),
        ((x0, y1, z0), (x0, y0, z0), (x0, y1, z1), (x0, y0, z1)),
    )
    normals = ((0, -1, 0), (0, 0, 1), (1, 0, 0), (-1, 0, 0))
    return [
        (np.array(corners), np.array(normal, dtype=np.float64), spine if k == 0 else cover)
        for k, (corners, normal) in enumerate(zip(faces, normals, strict=True))
    ]


def _of_quads(quads: Sequence[tuple[FloatArray, FloatArray, FloatArray]], material: str) -> Part:
    count = len(quads)
    triangles: Int32Array = (_QUAD + 4 * np.arange(count)[:, None, None]).reshape(-1, 3)
    return Part(
        np.concatenate([quad[0] for quad in quads]),
        np.repeat([quad[1] for quad in quads], 4, axis=0),
        np.concatenate([quad[2] for quad in quads]),
        triangles.astype(np.int32),
        material,
    )
