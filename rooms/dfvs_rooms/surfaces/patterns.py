"""Printed and knotted patterns: wallpaper, a rug, patterned cloth."""

import numpy as np

from dfvs_core.geometry.arrays import Float32Array
from dfvs_rooms.surfaces.textures import (
    SIZE_PX,
    Colour,
    blend,
    cloth,
    coordinates,
    noise,
    shaded,
    smoothstep,
)

RED, NAVY, CREAM, GOLD = (
    (0.50, 0.12, 0.11),
    (0.09, 0.14, 0.27),
    (0.86, 0.79, 0.64),
    (0.70, 0.50, 0.24),
)


def wallpaper(rng: np.random.Generator, ground: Colour, motif: Colour) -> Float32Array:
    """Mirrored tendrils and leaves in the manner of a damask, repeating."""
    x, y = coordinates()
    out = np.zeros((SIZE_PX, SIZE_PX), np.float32)
    for cx, cy in ((0.25, 0.25), (0.75, 0.75)):
        dx = np.abs((x - cx + 0.5) % 1.0 - 0.5)
        dy = (y - cy + 0.5) % 1.0 - 0.5
        r, angle = np.hypot(dx, dy), np.arctan2(dx, -dy)
        flower = 0.105 + 0.050 * np.cos(5 * angle) + 0.018 * np.cos(10 * angle)
        out = np.maximum(out, smoothstep(0.006, -0.006, r - flower))
        out = np.minimum(out, 1 - smoothstep(0.006, -0.006, np.abs(r - 0.045) - 0.008))
        for k, (lean, size) in enumerate(((0.75, 0.085), (1.5, 0.07), (2.35, 0.08))):
            lx = dx - 0.17 * np.sin(lean) * (1 + 0.15 * k)
            ly = -dy - 0.19 * np.cos(lean)
            u = lx * np.sin(lean) + ly * np.cos(lean)
            v = lx * np.cos(lean) - ly * np.sin(lean) + 1.5 * u * u
            leaf = (u / size) ** 2 + (v / (0.38 * size * (1.15 - u / size))) ** 2 - 1
            out = np.maximum(out, smoothstep(0.12, -0.12, leaf))
            out = np.where(leaf < 0, out * smoothstep(0.002, 0.006, np.abs(v)), out)
        stem = np.abs(dx - 0.05 - 0.05 * np.cos(2 * np.pi * (dy + 0.25) / 0.5)) - 0.006
        out = np.maximum(out, smoothstep(0.004, -0.004, stem) * (np.abs(dy) > 0.10))
        bud = np.hypot(dx / 0.6, np.abs(dy) - 0.235) - 0.026
        out = np.maximum(out, smoothstep(0.006, -0.006, bud))
    wear = 0.88 + 0.12 * smoothstep(-1.5, 0.5, noise(rng, slope=0.8, band=(4.0, 120.0)))
    image = blend(ground, motif, out.astype(np.float32) * wear)
    paper = (
        1 + 0.025 * noise(rng, slope=0.2, band=(40.0, 256.0)) + 0.02 * noise(rng, band=(2.0, 12.0))
    )
    return shaded(image, paper)


def rug(rng: np.random.Generator) -> Float32Array:
    """Knotted rug: a lattice of flowers, a medallion, four corners and three borders."""
    shape = (SIZE_PX, SIZE_PX * 3 // 2)
    x, y = coordinates(shape)
    a, b = np.abs(x - 0.5) * 3.0, np.abs(y - 0.5) * 2.0
    edge = np.minimum(1.5 - a, 1.0 - b)
    image = _rug_field(np.full((*shape, 3), RED, np.float32), a, b)
    angle, r = np.arctan2(b, a), np.hypot(a / 1.2, b)
    scallop = 0.52 + 0.035 * np.cos(16 * angle)
    for size, colour in ((1.0, GOLD), (0.95, NAVY), (0.72, GOLD), (0.68, CREAM), (0.40, RED)):
        image = blend(image, colour, smoothstep(0.010, -0.010, r - size * scallop))
    for radius, petal, count in ((0.43, 0.055, 16), (0.28, 0.05, 12), (0.0, 0.10, 8)):
        image = _rosettes(image, (angle, r), radius, petal, count)
    da, db = 1.2 - a, 0.7 - b
    corner = np.hypot(da / 1.25, db)
    turn = np.arctan2(db, da)
    for size, colour in ((0.46, GOLD), (0.435, NAVY), (0.30, CREAM), (0.27, NAVY), (0.12, GOLD)):
        wave = size * (1 + 0.06 * np.cos(20 * turn))
        image = blend(image, colour, smoothstep(0.010, -0.010, corner - wave) * (edge > 0.3))
    image = _rug_border(image, edge, a, b)
    knots = noise(rng, shape, slope=0.1, band=(60.0, 380.0))
    abrash = noise(rng, shape, slope=1.2, band=(2.0, 40.0), stretch=(4.0, 1.0))
    light = 1 + 0.10 * knots + 0.06 * abrash
    return shaded(image, light)


def _rug_field(image: Float32Array, a: Float32Array, b: Float32Array) -> Float32Array:
    """Rows of flowers joined by vines; a, b (H, W) are distances from the middle."""
    rows = 6.5
    row = np.floor(b * rows)
    u = (a * rows + 0.5 * (row % 2)) % 1.0 - 0.5
    v = (b * rows) % 1.0 - 0.5
    vine = np.abs(v - 0.16 * np.sin(2 * np.pi * (u + 0.25)))
    image = blend(image, GOLD, 0.8 * smoothstep(0.055, 0.035, vine))
    angle, r = np.arctan2(v, u), np.hypot(u, v)
    flower = 0.27 + 0.08 * np.cos(6 * angle)
    image = blend(image, NAVY, smoothstep(0.02, -0.02, r - flower - 0.05))
    image = blend(image, CREAM, smoothstep(0.02, -0.02, r - flower))
    return blend(image, RED, smoothstep(0.02, -0.02, r - 0.10))


def _rosettes(
    image: Float32Array,
    polar: tuple[Float32Array, Float32Array],
    radius: float,
    petal: float,
    count: int,
) -> Float32Array:
    """Ring of round petals about the middle, polar = (angle, r)."""
    angle, r = polar
    if radius == 0.0:
        star = petal * (1 + 0.35 * np.cos(count * angle))
        image = blend(image, CREAM, smoothstep(0.01, -0.01, r - star))
        return blend(image, NAVY, smoothstep(0.01, -0.01, r - 0.4 * petal))
    step = 2 * np.pi / count
    nearest = (angle / step + 0.5) % 1.0 - 0.5
    distance = np.hypot(nearest * step * radius, r - radius)
    image = blend(
        image, CREAM if radius > 0.35 else NAVY, smoothstep(0.008, -0.008, distance - petal)
    )
    return blend(image, RED, smoothstep(0.008, -0.008, distance - 0.5 * petal))


def _rug_border(
    image: Float32Array, edge: Float32Array, a: Float32Array, b: Float32Array
) -> Float32Array:
    """Bands along the edge of the rug; edge (H, W) is the distance from it, a, b as above."""
    along = np.where(1.5 - a < 1.0 - b, 0.81 - b, 1.31 - a)
    for width, colour in ((0.30, GOLD), (0.285, NAVY), (0.095, CREAM), (0.08, RED), (0.03, NAVY)):
        image = blend(image, colour, (edge < width).astype(np.float32))
    across = (edge - 0.19) / 0.1
    rosette = np.hypot(((along * 5.0 + 0.5) % 1.0 - 0.5) * 2.0, across)
    inside = (np.abs(across) < 0.9).astype(np.float32)
    image = blend(image, RED, smoothstep(0.75, 0.68, rosette) * inside)
    image = blend(image, CREAM, smoothstep(0.45, 0.40, rosette) * inside)
    image = blend(image, GOLD, smoothstep(0.2, 0.15, rosette) * inside)
    diamonds = np.abs((along * 20.0) % 1.0 - 0.5) + np.abs(edge - 0.055) / 0.05
    return blend(image, CREAM, smoothstep(0.5, 0.42, diamonds))


def pattern_cloth(
    rng: np.random.Generator, kind: str, first: Colour, second: Colour
) -> Float32Array:
    """Printed cloth: ``chevron``, ``dots``, ``stripes`` or ``ikat``."""
    x, y = coordinates()
    if kind == "chevron":
        mask = ((y * 10 + np.abs((x * 8) % 1 - 0.5)) % 1 < 0.5).astype(np.float32)
    elif kind == "dots":
        shift = 0.5 * (np.floor(y * 12) % 2)
        mask = smoothstep(0.34, 0.28, np.hypot((x * 12 + shift) % 1 - 0.5, (y * 12) % 1 - 0.5))
    elif kind == "stripes":
        t = (x * 6) % 1
        mask = ((t < 0.4) | ((t > 0.5) & (t < 0.55)) | ((t > 0.85) & (t < 0.9))).astype(np.float32)
    else:
        d = np.abs((x * 4) % 1 - 0.5) + np.abs((y * 4) % 1 - 0.5)
        mask = smoothstep(
            -0.2, 0.2, np.cos(2 * np.pi * 3 * d) + 0.3 * noise(rng, slope=0.5, band=(20, 200))
        )
    base = cloth(rng, (1.0, 1.0, 1.0), 128) * 0.92
    image = blend(first, second, mask.astype(np.float32))
    return np.clip(image * base, 0, 1).astype(np.float32)
