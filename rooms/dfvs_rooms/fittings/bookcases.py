"""Bookcases for many books: a book is eight triangles, a shelf of them one mesh."""

import numpy as np

from dfvs_rooms.generator.solids import Part, as_one, box, panel, placed, quad_triangles
from dfvs_rooms.surfaces.artwork import SPINES


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
    row: list[Part] = []
    x, gap = -width / 2, float(rng.uniform(-0.9, 0.5)) * width
    base, deep = float(rng.uniform(0.62, 0.8)), float(rng.uniform(0.66, 0.8)) * depth
    while x < width / 2 - 0.05:
        thick = float(rng.uniform(0.018, 0.05))
        tall = min(0.95, base + float(rng.uniform(-0.09, 0.14))) * height
        if not gap < x < gap + 0.12:
            low = (x, depth / 2 - 0.025 - deep - float(rng.uniform(0.0, 0.02)), 0.0)
            row.append(_book(low, (thick, deep, tall), int(rng.integers(SPINES)), books))
        x += thick + 0.001
    return as_one(row or [_book((-0.02, 0.0, 0.0), (0.04, 0.1, 0.7 * height), 0, books)])


def _book(
    low: tuple[float, float, float], size: tuple[float, float, float], which: int, books: str
) -> Part:
    """Spine, top and both sides of a book."""
    x0, y0, z0 = low
    x1, y1, z1 = x0 + size[0], y0 + size[1], z0 + size[2]
    left, right = (which + 0.04) / SPINES, (which + 0.96) / SPINES
    spine = np.array([[left, 1.0], [right, 1.0], [left, 0.0], [right, 0.0]])
    plain = np.array([[0.0, 0.05], [1.0, 0.05], [0.0, 0.01], [1.0, 0.01]])
    cover = plain * [0.1 / SPINES, 1.0] + [(which + 0.45) / SPINES, 0.0]
    faces = (
        ((x0, y0, z0), (x1, y0, z0), (x0, y0, z1), (x1, y0, z1)),
        ((x0, y0, z1), (x1, y0, z1), (x0, y1, z1), (x1, y1, z1)),
        ((x1, y0, z0), (x1, y1, z0), (x1, y0, z1), (x1, y1, z1)),
        ((x0, y1, z0), (x0, y0, z0), (x0, y1, z1), (x0, y0, z1)),
    )
    normals = np.array([[0.0, -1.0, 0.0], [0.0, 0.0, 1.0], [1.0, 0.0, 0.0], [-1.0, 0.0, 0.0]])
    return Part(
        np.reshape(faces, (-1, 3)),
        np.repeat(normals, 4, axis=0),
        np.concatenate([spine, cover, cover, cover]),
        quad_triangles(len(faces)),
        books,
    )
