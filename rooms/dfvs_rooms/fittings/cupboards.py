"""Fitted kitchens: cupboards, worktops and appliances. Fronts look to -y, backs stand at y = 0."""

import itertools
from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from dfvs_rooms.generator.solids import Part, box, disc, lathe, panel, placed, tube

UNIT_M = 0.6
DEEP_M, TOP_M = 0.6, 0.9
_PLINTH_M, _SLAB_M = 0.1, 0.035


def front(width: float, height: float, paint: str, *, handle: str = "right") -> list[Part]:
    """Shaker door or drawer front, its back at y = 0 and its lower middle at the origin."""
    w, h, rail = width - 0.006, height - 0.006, 0.06
    parts = box((w, 0.016, h), (0, -0.008, 0.003), paint, skip="+y", edge_m=0.15)
    for side in (-1, 1):
        upright = (side * (w - rail) / 2, -0.02, 0.003)
        parts += box((rail, 0.008, h), upright, paint, skip="+y", edge_m=0.3)
        z = 0.003 + (h - rail if side > 0 else 0.0)
        parts += box((w - 2 * rail, 0.008, rail), (0, -0.02, z), paint, skip="+y", edge_m=0.3)
    return parts + _handle(w, h, handle)


def _handle(w: float, h: float, where: str) -> list[Part]:
    if where == "drawer":
        z = h / 2 if h < 0.3 else h - 0.08
        return [tube((-0.07, -0.045, z), (0.07, -0.045, z), 0.006, "brass", sides=6)]
    x = (w / 2 - 0.035) * (1 if where == "right" else -1)
    z = h - 0.2 if where != "low" else 0.06
    return [tube((x, -0.045, z), (x, -0.045, z + 0.13), 0.006, "brass", sides=6)]


def base_unit(rng: np.random.Generator) -> list[Part]:
    """Cupboard under the worktop, with a door or drawers, left end at x = -0.3."""
    high = TOP_M - _SLAB_M - _PLINTH_M
    parts = box((UNIT_M, DEEP_M - 0.05, high), (0, -DEEP_M / 2 + 0.02, _PLINTH_M), "sage")
    parts += box((UNIT_M, DEEP_M - 0.12, _PLINTH_M), (0, -DEEP_M / 2 + 0.06, 0), "black", skip="-z")
    face_y = -DEEP_M + 0.045
    if rng.random() < 0.45:
        for z, h in ((0.0, 0.3), (0.3, 0.26), (0.56, high - 0.56)):
            drawer = front(UNIT_M, h, "sage", handle="drawer")
            parts += placed(drawer, 0, face_y, _PLINTH_M + z)
        return parts
    side = "right" if rng.random() < 0.5 else "left"
    return parts + placed(front(UNIT_M, high, "sage", handle=side), 0, face_y, _PLINTH_M)


def oven() -> list[Part]:
    """Oven under a hob of four rings, as wide as a unit, worktop included."""
    parts = box((UNIT_M, DEEP_M - 0.03, TOP_M - 0.1), (0, -DEEP_M / 2, 0.1), "steel", skip="-z")
    parts += box((UNIT_M, DEEP_M - 0.12, 0.1), (0, -DEEP_M / 2 + 0.06, 0), "black", skip="-z")
    glass = (-0.24, -DEEP_M + 0.012, 0.22)
    parts.append(panel(glass, (0.48, 0, 0), (0, 0, 0.36), "black", edge_m=0.2))
    y = -DEEP_M - 0.03
    parts.append(tube((-0.24, y, 0.66), (0.24, y, 0.66), 0.011, "steel", sides=8))
    for x in np.linspace(-0.22, 0.22, 5):
        knob = (float(x), -DEEP_M + 0.015, 0.79)
        parts.append(tube(knob, (knob[0], knob[1] - 0.03, 0.79), 0.019, "black", sides=12))
    parts += box((UNIT_M - 0.02, DEEP_M - 0.06, 0.008), (0, -DEEP_M / 2, TOP_M), "black", skip="-z")
    for x in (-0.14, 0.14):
        for y in (-0.43, -0.18):
            ring = lathe([(0.09, 0.0), (0.085, 0.012), (0.06, 0.012), (0.055, 0.0)], "metal")
            parts += placed([ring], x, y, TOP_M + 0.008)
    return parts


def sink() -> list[Part]:
    """Basin with a tap, to stand in a worktop."""
    parts = box((0.5, 0.4, 0.012), (0, -0.3, TOP_M), "steel", skip="-z")
    low = panel((-0.2, -0.45, TOP_M + 0.0125), (0.4, 0, 0), (0, 0.26, 0), "metal", edge_m=0.1)
    neck = [(0, -0.11, TOP_M), (0, -0.11, TOP_M + 0.26), (0, -0.2, TOP_M + 0.33)]
    neck += [(0, -0.29, TOP_M + 0.3), (0, -0.3, TOP_M + 0.22)]
    pipes = [tube(a, b, 0.013, "steel", sides=8) for a, b in itertools.pairwise(neck)]
    return [*parts, low, *pipes]


def run_of_units(rng: np.random.Generator, plan: Sequence[str]) -> list[Part]:
    """Cupboards side by side under one worktop, centred; ``plan`` names unit, oven, sink."""
    width = UNIT_M * len(plan)
    top = (0, -DEEP_M / 2 - 0.005, TOP_M - _SLAB_M)
    parts = box((width, DEEP_M + 0.01, _SLAB_M), top, "worktop")
    for k, what in enumerate(plan):
        unit = oven() if what == "oven" else base_unit(rng)
        if what == "sink":
            unit += sink()
        parts += placed(unit, UNIT_M * (k + 0.5) - width / 2, 0)
    return parts


def wall_units(rng: np.random.Generator, count: int) -> list[Part]:
    """Cupboards that hang, their middle at the origin."""
    high, deep, width = 0.72, 0.33, UNIT_M * count
    parts = box((width, deep, high), (0, -deep / 2, -high / 2), "sage")
    for k in range(count):
        side = "low" if rng.random() < 0.5 else "left"
        door = front(UNIT_M, high, "sage", handle=side)
        parts += placed(door, UNIT_M * (k + 0.5) - width / 2, -deep, -high / 2)
    return parts


def hood() -> list[Part]:
    """Extractor hood with its chimney, its lower edge 0.36 m below the origin."""
    slope = [(0.42, -0.36), (0.42, -0.31), (0.16, -0.12), (0.16, 0.36)]
    shape = lathe(slope, "steel", sides=4, is_sheet=True).moved(0, 0, 0, 45)
    return [replace(shape, vertices=shape.vertices * [1.0, 0.8, 1.0] + [0, -0.24, 0])]


def fridge() -> list[Part]:
    """Tall refrigerator of two doors."""
    parts = box((0.68, 0.64, 1.85), (0, -0.34, 0.02), "steel", skip="-z")
    for z, h in ((0.03, 0.62), (0.66, 1.2)):
        parts += box((0.67, 0.03, h), (0, -0.675, z), "steel", skip="+y")
        low, high = (-0.28, -0.73, z + 0.35 * h), (-0.28, -0.73, z + 0.75 * h)
        parts.append(tube(low, high, 0.012, "metal", sides=8))
    return parts


def open_shelf(width: float, wood: str) -> list[Part]:
    """Board on two brackets, its top at the origin."""
    parts = box((width, 0.24, 0.03), (0, -0.12, -0.03), wood)
    for x in (-width / 2 + 0.1, width / 2 - 0.1):
        parts += box((0.02, 0.18, 0.1), (x, -0.09, -0.13), "black", skip="+y +z", edge_m=0.2)
    return parts


def stool(seat: str) -> list[Part]:
    """Round bar stool on four legs."""
    parts = [
        lathe([(0.17, 0.62), (0.18, 0.64), (0.17, 0.66)], seat),
        disc(0.17, (0, 0, 0.66), seat),
    ]
    for angle in np.radians([45, 135, 225, 315]):
        foot = (0.19 * np.cos(angle), 0.19 * np.sin(angle), 0.0)
        parts.append(tube(foot, (0.6 * foot[0], 0.6 * foot[1], 0.63), 0.013, "black", sides=7))
    return parts
