"""Smaller things: artworks, plants, lamps, curtains, a radiator, a door.

Things on a wall hang at the origin with their back at y = 0 and look to -y.
"""

from dataclasses import replace

import numpy as np

from dfvs_rooms.generator.furniture import book_row
from dfvs_rooms.generator.solids import (
    EDGE_M,
    Part,
    box,
    cushion,
    disc,
    lathe,
    panel,
    placed,
    sheet,
    sphere,
    tilted,
    tube,
)


def framed_artwork(width: float, height: float, artwork: str, frame: str) -> list[Part]:
    """Artwork in a frame, its middle at the origin."""
    bar, deep = 0.035, 0.03
    parts = [
        panel(
            (-width / 2, -0.015, -height / 2),
            (width, 0, 0),
            (0, 0, height),
            artwork,
            stretched=True,
        )
    ]
    for side in (-1, 1):
        across = (width + 2 * bar, deep, bar)
        z = side * (height + bar) / 2 - bar / 2
        parts += box(across, (0, -deep / 2, z), frame, skip="+y", edge_m=0.15)
        upright = (bar, deep, height)
        x = side * (width + bar) / 2
        parts += box(upright, (x, -deep / 2, -height / 2), frame, skip="+y", edge_m=0.15)
    return parts


def wall_shelf(rng: np.random.Generator, width: float) -> list[Part]:
    """Board on two brackets with books and a vase, its top at the origin."""
    parts = box((width, 0.22, 0.025), (0, -0.11, -0.025), "oak", edge_m=0.08)
    for x in (-width / 2 + 0.12, width / 2 - 0.12):
        parts += box((0.02, 0.17, 0.10), (x, -0.085, -0.125), "black", skip="+y +z")
    row = book_row(rng, width * 0.6, 0.30, 0.22)
    parts += placed(row, -width * 0.17, -0.11)
    return [*parts, *placed([vase(0.22, "glaze")], width * 0.33, -0.11)]


def clock(radius: float, rim: str) -> list[Part]:
    """Round wall clock."""
    flat = disc(radius, (0, 0, 0), "clock", sides=32)
    uv = 0.5 + 0.5 * flat.vertices[:, :2] / radius * [1, -1]
    dial = tilted(replace(flat, uv=uv), (1, 0, 0), 90)
    ring = lathe([(radius, -0.03), (radius + 0.012, 0.0), (radius, 0.012)], rim, sides=32)
    return placed([dial, tilted(ring, (1, 0, 0), 90)], 0, -0.03, 0)


def curtain(rng: np.random.Generator, width: float, height: float) -> list[Part]:
    """Gathered curtain that hangs from z = height to just above the floor."""
    rows, columns = int(height / 0.16), int(width / 0.022)
    s = np.linspace(0.0, 1.0, columns + 1)[None, :]
    z = np.linspace(0.015, height, rows + 1)[:, None]
    phase = 2 * np.pi * (s * width / 0.13) + 0.7 * np.sin(9 * s + rng.uniform(0, 6))
    depth = 0.022 + 0.020 * (1 - z / height)
    sway = 0.012 * np.sin(2.2 * z + 5 * s)
    x = np.broadcast_to((s - 0.5) * width, (rows + 1, columns + 1)) + sway
    y = depth * np.sin(phase)
    points = np.stack([x, y, np.broadcast_to(z, x.shape)], -1)
    u = np.broadcast_to(s * width * 1.9, x.shape)
    uv = np.stack([u, np.broadcast_to(-z, x.shape)], -1)
    return [sheet(points, uv, "drape")]


def curtain_rail(width: float) -> list[Part]:
    """Rail with knobs at its ends, centred at the origin."""
    parts = [tube((-width / 2, 0, 0), (width / 2, 0, 0), 0.014, "brass", sides=8)]
    parts += [sphere(0.03, (side * width / 2, 0, 0), "brass", sides=12) for side in (-1, 1)]
    for x in (-width / 2 + 0.15, width / 2 - 0.15):
        parts.append(tube((x, 0, 0), (x, 0.10, 0), 0.01, "brass", sides=6))
    return parts


def radiator(width: float, height: float) -> list[Part]:
    """Ribbed radiator on feet, its back 5 cm from the wall."""
    parts: list[Part] = []
    count = int(width / 0.06)
    for k in range(count):
        x = -width / 2 + width * (k + 0.5) / count
        parts += cushion((0.05, 0.10, height), (x, -0.10, 0.10), "white", power=6, edge_m=0.16)
    for z in (0.16, height + 0.02):
        parts.append(tube((-width / 2, -0.10, z), (width / 2, -0.10, z), 0.016, "white", sides=8))
    for x in (-width / 2 + 0.1, width / 2 - 0.1):
        parts.append(tube((x, -0.10, 0.0), (x, -0.10, 0.14), 0.012, "white", sides=8))
    return parts


def pot(radius: float, height: float, clay: str) -> list[Part]:
    """Flower pot with earth in it."""
    r = radius
    profile = [(0.02, 0.0), (0.70 * r, 0.0), (0.78 * r, 0.3 * height), (0.95 * r, 0.85 * height)]
    profile += [
        (1.05 * r, 0.86 * height),
        (1.05 * r, height),
        (0.93 * r, height),
        (0.9 * r, 0.88 * height),
    ]
    return [lathe(profile, clay, sides=24), disc(0.92 * r, (0, 0, 0.9 * height), "earth")]


def _leaf(length: float, width: float, droop: float, material: str) -> Part:
    """Leaf that starts at the origin along +x, rises and droops."""
    t = np.linspace(0.0, 1.0, 9)[:, None]
    s = np.linspace(-1.0, 1.0, 5)[None, :]
    half = width * np.sin(np.pi * np.clip(t, 0.02, 0.985) ** 0.8)
    x = length * np.sin(droop * t) / max(droop, 1e-6) + 0 * s
    z = length * (0.75 * t - 0.9 * droop * t**2) + 0.35 * half * np.abs(s)
    y = half * s
    uv = np.stack(np.broadcast_arrays(0.5 + 0.5 * s, 1.0 - t), -1)
    return sheet(np.stack([x, y + 0 * x, z], -1), uv, material)


def palm(rng: np.random.Generator, height: float, pot_radius: float = 0.17) -> list[Part]:
    """Pot plant with long arching leaves that spring from its middle."""
    parts = pot(pot_radius, 1.76 * pot_radius, "clay")
    for k in range(26 if height > 0.4 else 14):
        length = height * float(rng.uniform(0.75, 1.25))
        width = 0.04 * height + 0.012 * rng.random()
        blade = _leaf(length, width, float(rng.uniform(0.3, 1.0)), "fern")
        turn = 137.5 * k + float(rng.uniform(-15, 15))
        lean = tilted(blade, (0, 1, 0), -float(rng.uniform(5, 38)))
        parts.append(lean.moved(0.0, 0.0, 1.6 * pot_radius, turn))
    return parts


def rubber_tree(rng: np.random.Generator, height: float) -> list[Part]:
    """Pot plant with stems and broad leaves all along them."""
    parts = pot(0.19, 0.34, "glaze")
    for stem in range(3):
        angle = 2.1 * stem + float(rng.uniform(0, 0.6))
        top = np.array([0.22 * np.cos(angle), 0.22 * np.sin(angle), height * (1 - 0.15 * stem)])
        foot = np.array([0.03 * np.cos(angle), 0.03 * np.sin(angle), 0.30])
        parts.append(tube(tuple(foot), tuple(top), (0.014, 0.008), "walnut", sides=7))
        for k in range(11):
            t = 0.22 + 0.78 * k / 10
            at = foot + (top - foot) * t
            length, droop = float(rng.uniform(0.17, 0.27)), float(rng.uniform(0.6, 1.4))
            blade = _leaf(length, 0.055, droop, "rubber")
            parts.append(blade.moved(at[0], at[1], at[2], 137.5 * k + 60.0 * stem))
    return parts


def pendant_lamp(drop: float, radius: float) -> list[Part]:
    """Opal globe that hangs ``drop`` m below the origin, which is on the ceiling."""
    globe = replace(sphere(radius, (0, 0, -drop), "globe", sides=28), emission=1.0)
    cord = tube((0, 0, -drop + radius), (0, 0, 0), 0.006, "black", sides=6)
    cap = lathe(
        [
            (0.05, -drop + radius - 0.015),
            (0.05, -drop + radius + 0.03),
            (0.006, -drop + radius + 0.05),
        ],
        "brass",
    )
    rose = lathe([(0.06, -0.03), (0.055, -0.005), (0.055, 0.0)], "brass")
    return [globe, cord, cap, rose]


def floor_lamp(height: float) -> list[Part]:
    """Standing lamp with a drum shade of cloth, lit inside."""
    parts = [lathe([(0.15, 0.0), (0.15, 0.018), (0.02, 0.03), (0.012, 0.04)], "brass")]
    parts.append(tube((0, 0, 0.03), (0, 0, height - 0.15), 0.011, "brass", sides=8))
    parts += _shade(0.21, 0.17, height - 0.30, height)
    return parts


def table_lamp() -> list[Part]:
    """Lamp with a turned foot and a cloth shade."""
    profile = [
        (0.02, 0.0), (0.075, 0.0), (0.08, 0.015), (0.03, 0.05), (0.07, 0.13), (0.075, 0.18),
        (0.03, 0.26), (0.012, 0.29),
    ]  # fmt: skip
    return [lathe(profile, "glaze", sides=20), *_shade(0.16, 0.11, 0.28, 0.50)]


def _shade(lower: float, upper: float, bottom: float, top: float) -> list[Part]:
    """Lamp shade with a glowing bulb inside."""
    z = np.linspace(bottom, top, 6)
    r = np.interp(z, [bottom, top], [lower, upper])
    cone = lathe(list(zip(r, z, strict=True)), "linen", sides=28, is_sheet=True)
    bulb = sphere(0.05, (0, 0, bottom + 0.45 * (top - bottom)), "globe", sides=12)
    return [cone, replace(bulb, emission=3.0)]


def vase(height: float, glaze: str) -> Part:
    """Bellied vase."""
    h = height
    profile = [
        (0.01, 0.0), (0.22 * h, 0.0), (0.34 * h, 0.25 * h), (0.30 * h, 0.55 * h),
        (0.13 * h, 0.80 * h), (0.15 * h, 0.96 * h), (0.17 * h, h), (0.12 * h, 0.97 * h),
    ]  # fmt: skip
    return lathe(profile, glaze, sides=22)


def fruit_bowl(rng: np.random.Generator) -> list[Part]:
    """Bowl with oranges and apples."""
    profile = [
        (0.01, 0.0), (0.06, 0.0), (0.07, 0.01), (0.14, 0.05), (0.17, 0.09), (0.165, 0.09),
        (0.13, 0.055), (0.05, 0.02), (0.005, 0.018),
    ]  # fmt: skip
    parts = [lathe(profile, "glaze", sides=26)]
    for k in range(7):
        angle, r = 2 * np.pi * k / 6, 0.075 if k < 6 else 0.0
        radius = float(rng.uniform(0.034, 0.040))
        at = (r * np.cos(angle), r * np.sin(angle), 0.075 if k < 6 else 0.125)
        parts.append(sphere(radius, at, "orange" if k % 2 else "apple", sides=14))
    return parts


def rug(
    material: str, width: float, depth: float, *, stretched: bool = True, edge_m: float = EDGE_M
) -> list[Part]:
    """Rug, 12 mm thick."""
    corner = (-width / 2, -depth / 2, 0.012)
    top = panel(corner, (width, 0, 0), (0, depth, 0), material, edge_m=edge_m, stretched=stretched)
    return [top, *box((width, depth, 0.0118), (0, 0, 0), "linen", skip="+z -z", edge_m=0.2)]


def basket(radius: float, height: float) -> list[Part]:
    """Wicker basket with a folded blanket in it."""
    parts = [
        lathe(
            [
                (0.8 * radius, 0.0), (radius, 0.5 * height), (0.95 * radius, height),
                (0.90 * radius, height), (0.9 * radius, 0.7 * height),
            ],
            "wicker",
            sides=24,
        )
    ]  # fmt: skip
    soft = cushion((1.3 * radius, 1.3 * radius, 0.16), (0, 0, height - 0.08), "ikat", power=3)
    return parts + soft


def door(width: float, height: float, panel_paint: str, frame_paint: str) -> list[Part]:
    """Panelled door in its frame, with a handle, its foot at the origin."""
    parts = box((width, 0.03, height), (0, -0.015, 0.0), panel_paint, skip="+y -z")
    for x in (-0.25, 0.25):
        for z, h in ((0.16, 0.62), (0.92, 0.98)):
            at = (x * width * 0.92, -0.038, z)
            parts += box((0.36 * width, 0.016, h), at, panel_paint, skip="+y")
    bar = 0.09
    for side in (-1, 1):
        at = (side * (width + bar) / 2, -0.025, 0.0)
        parts += box((bar, 0.05, height + bar), at, frame_paint, skip="+y -z", edge_m=0.12)
    parts += box((width, 0.05, bar), (0, -0.025, height), frame_paint, skip="+y -x +x", edge_m=0.12)
    x = width / 2 - 0.07
    parts.append(tube((x, -0.03, 1.03), (x, -0.085, 1.03), 0.011, "brass", sides=8))
    parts.append(tube((x + 0.01, -0.08, 1.03), (x - 0.11, -0.08, 1.03), 0.010, "brass", sides=8))
    parts += box((0.04, 0.006, 0.16), (x, -0.033, 0.95), "brass", skip="+y")
    return parts
