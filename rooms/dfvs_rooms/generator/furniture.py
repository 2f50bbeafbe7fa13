"""Seats, tables and cupboards. Each stands on the floor at the origin, its front towards -y."""

from dataclasses import replace

import numpy as np

from dfvs_rooms.generator.solids import Part, box, corners, cushion, panel, placed, tilted, tube
from dfvs_rooms.surfaces.artwork import SPINES


def sofa(width: float, cloth: str, pillows: tuple[str, ...]) -> list[Part]:
    """Sofa with two seats or more, arms, back cushions and a few pillows."""
    depth, arm = 0.92, 0.20
    inner = width - 2 * arm
    parts = cushion((width, depth, 0.26), (0, 0, 0.10), cloth, power=14)
    parts += cushion((width, 0.24, 0.72), (0, depth / 2 - 0.12, 0.12), cloth, power=9)
    for side in (-1, 1):
        parts += cushion((arm, depth, 0.50), (side * (width - arm) / 2, 0, 0.12), cloth, power=8)
        for y in (-0.36, 0.36):
            leg = (side * (width / 2 - 0.10), y)
            parts.append(tube((*leg, 0.0), (*leg, 0.12), 0.025, "walnut", sides=8))
    seats = max(1, round(inner / 0.75))
    for k in range(seats):
        x = -inner / 2 + inner * (k + 0.5) / seats
        parts += cushion((inner / seats - 0.01, 0.68, 0.17), (x, -0.11, 0.33), cloth, power=7)
        back = cushion((inner / seats - 0.02, 0.18, 0.44), (0, 0, 0), cloth, power=5)
        parts += placed([tilted(p, (1, 0, 0), -10) for p in back], x, 0.20, 0.46)
    for k, pillow in enumerate(pillows):
        soft = cushion((0.42, 0.15, 0.40), (0, 0, 0), pillow, power=3.2, edge_m=0.05)
        x = (-1) ** k * (inner / 2 - 0.26 - 0.34 * (k // 2))
        turn = -12.0 * (-1) ** k
        parts += placed([tilted(p, (1, 0, 0), -20) for p in soft], x, 0.02, 0.49, turn)
    return parts


def armchair(cloth: str, pillow: str) -> list[Part]:
    """One-seat sofa."""
    return sofa(0.98, cloth, (pillow,))


def table(size: tuple[float, float, float], top: str, legs: str) -> list[Part]:
    """Table of (width, depth, height) with an apron and tapered legs."""
    width, depth, height = size
    parts = box((width, depth, 0.035), (0, 0, height - 0.035), top, edge_m=0.07)
    for foot in corners(width / 2 - 0.06, depth / 2 - 0.06):
        parts.append(tube((*foot, 0.0), (*foot, height - 0.03), (0.018, 0.030), legs, sides=8))
    for y in (-1, 1):
        at = (0, y * (depth / 2 - 0.07), height - 0.105)
        parts += box((width - 0.16, 0.02, 0.07), at, legs, skip="+z", edge_m=0.12)
    for x in (-1, 1):
        end = (x * (width / 2 - 0.07), 0, height - 0.105)
        parts += box((0.02, depth - 0.16, 0.07), end, legs, skip="+z", edge_m=0.12)
    return parts


def chair(seat: str) -> list[Part]:
    """Dining chair with a slatted back and an upholstered seat."""
    parts = cushion((0.43, 0.43, 0.06), (0, 0, 0.43), seat, power=6, edge_m=0.08)
    parts += box((0.42, 0.42, 0.035), (0, 0, 0.405), "walnut", skip="+z", edge_m=0.14)
    for x in (-0.19, 0.19):
        parts.append(tube((x, -0.19, 0.0), (x, -0.19, 0.42), (0.014, 0.02), "walnut", sides=8))
        parts.append(tube((x, 0.21, 0.0), (x, 0.19, 0.45), (0.014, 0.02), "walnut", sides=8))
        parts.append(tube((x, 0.19, 0.45), (x, 0.26, 0.93), (0.02, 0.014), "walnut", sides=8))
    for z, y in ((0.62, 0.215), (0.74, 0.232), (0.86, 0.25)):
        parts += box((0.38, 0.018, 0.055), (0, y, z), "walnut", edge_m=0.14)
    return parts


def pouf(cloth: str) -> list[Part]:
    """Round footstool."""
    return cushion((0.52, 0.52, 0.36), (0, 0, 0), cloth, power=2.8, edge_m=0.07)


def bookcase(rng: np.random.Generator, size: tuple[float, float, float]) -> list[Part]:
    """Open bookcase of (width, depth, height) with rows of books and gaps for ornaments."""
    width, depth, height = size
    board = 0.025
    parts = []
    for x in (-1, 1):
        at = (x * (width - board) / 2, 0, 0)
        parts += box((board, depth, height), at, "walnut", skip="-z")
    back = ((-width / 2, depth / 2 - 0.01, 0.0), (width, 0, 0), (0, 0, height))
    parts.append(panel(*back, "walnut", edge_m=0.08))
    outside = ((width / 2, depth / 2, 0.0), (-width, 0, 0), (0, 0, height))
    parts.append(panel(*outside, "walnut", edge_m=0.3))
    levels = np.linspace(0.06, height - board, max(3, round(height / 0.36)) + 1)
    inner = width - 2 * board
    for k, z in enumerate(levels):
        parts += box((inner, depth - 0.012, board), (0, -0.005, z), "walnut", skip="-x +x")
        if k + 1 < len(levels):
            room = float(levels[k + 1] - z - board)
            parts += placed(book_row(rng, inner - 0.02, room, depth), 0, 0, z + board)
    return parts


def book_row(rng: np.random.Generator, width: float, room: float, depth: float) -> list[Part]:
    """Books on one shelf, standing, with a gap and perhaps a leaning one."""
    parts: list[Part] = []
    x, end = -width / 2, width / 2
    gap_at = float(rng.uniform(-0.1, 0.8)) * width - width / 2
    while x < end - 0.05:
        thick = float(rng.uniform(0.022, 0.048))
        tall, deep = float(rng.uniform(0.68, 0.93)) * room, float(rng.uniform(0.62, 0.78)) * depth
        if gap_at < x < gap_at + 0.16:
            x += 0.16
            continue
        at = (x + thick / 2, depth / 2 - 0.025 - deep / 2, 0.0)
        parts += book((thick, deep, tall), at, int(rng.integers(SPINES)), "books")
        x += thick + 0.001
    return parts


def book(
    size: tuple[float, float, float], base: tuple[float, float, float], which: int, books: str
) -> list[Part]:
    """Standing book whose spine, cut from an image of spines, looks to -y."""
    parts = []
    for k, face in enumerate(box(size, base, books, edge_m=0.2, skip="-z +y")):
        u = face.uv[:, 0] - face.uv[:, 0].min()
        v = face.uv[:, 1] - face.uv[:, 1].min()
        u = u / max(float(u.max()), 1e-9)
        v = v / max(float(v.max()), 1e-9)
        if k > 0:
            u, v = 0.45 + 0.1 * u, 0.01 + 0.05 * v
        uv = np.stack([(which + 0.04 + 0.92 * u) / SPINES, v], axis=1)
        parts.append(replace(face, uv=uv))
    return parts


def book_pile(rng: np.random.Generator, count: int, books: str) -> list[Part]:
    """Books lying on top of each other."""
    parts: list[Part] = []
    z = 0.0
    for _ in range(count):
        thick, deep, tall = rng.uniform(0.02, 0.04), rng.uniform(0.15, 0.19), rng.uniform(0.2, 0.27)
        standing = book((thick, deep, tall), (0, 0, -tall / 2), int(rng.integers(SPINES)), books)
        lying = [tilted(p, (0, 1, 0), 90) for p in standing]
        parts += placed(lying, 0, 0, z + thick / 2, float(rng.uniform(-25, 25)))
        z += thick
    return parts


def sideboard(size: tuple[float, float, float]) -> list[Part]:
    """Low cupboard on legs with three doors and knobs."""
    width, depth, height = size
    foot = 0.12
    parts = box((width, depth, height - foot), (0, 0, foot), "oak", edge_m=0.08)
    for leg in corners(width / 2 - 0.07, depth / 2 - 0.06):
        parts.append(tube((*leg, 0.0), (*leg, foot), (0.014, 0.022), "oak", sides=8))
    for k in range(3):
        w = (width - 0.08) / 3
        middle = -width / 2 + 0.04 + w * (k + 0.5)
        at = (middle, -depth / 2 - 0.009, foot + 0.04)
        parts += box((w - 0.008, 0.018, height - foot - 0.08), at, "sage", skip="+y")
        knob = (middle + (w / 2 - 0.05) * (1 if k < 2 else -1), -depth / 2 - 0.018, height - 0.18)
        parts.append(tube(knob, (knob[0], knob[1] - 0.025, knob[2]), 0.012, "brass", sides=10))
        parts += box((0.026, 0.006, 0.026), (knob[0], knob[1] - 0.026, knob[2] - 0.013), "brass")
    return parts
