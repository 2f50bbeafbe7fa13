"""Surfaces that are laid, cast or scattered: tiles, slabs, parquet, terrazzo, boards, leaves.

As in ``textures.py``, every function returns (H, W, 3) float32 sRGB in 0 to 1 that repeats without
a seam.
"""

from collections.abc import Sequence
from dataclasses import dataclass

import cv2
import numpy as np

from dfvs_core.geometry.arrays import Float32Array, FloatArray
from dfvs_rooms.surfaces import textures
from dfvs_rooms.surfaces.textures import SIZE_PX, Colour, blend, noise, ramp, shaded, smoothstep


@dataclass(frozen=True, slots=True)
class Bond:
    """How stones are laid."""

    rows: int
    columns: int
    """Both are stones to the image; rows are even where they are staggered."""
    tones: tuple[Colour, ...]
    """Colours between which the stones vary."""
    joint: Colour
    stagger: float = 0.5
    """Shift of every second row, in stones."""
    joint_px: float = 3.0
    wobble_px: float = 0.0
    """How crooked the edges are."""
    grain: float = 0.05
    """Roughness of a stone's face."""


def masonry(rng: np.random.Generator, bond: Bond) -> Float32Array:
    """Tiles, slabs or stones in courses; each has a tone and a slant of its own."""
    y, x = np.mgrid[0:SIZE_PX, 0:SIZE_PX].astype(np.float32) + 0.5
    if bond.wobble_px > 0:
        x = x + bond.wobble_px * noise(rng, slope=1.2, band=(3.0, 40.0))
        y = y + bond.wobble_px * noise(rng, slope=1.2, band=(3.0, 40.0))
    v = y / SIZE_PX * bond.rows
    row = np.floor(v).astype(int)
    u = x / SIZE_PX * bond.columns + bond.stagger * (row % 2)
    column = np.floor(u).astype(int)
    fu, fv = u - column, v - row
    wide, high = SIZE_PX / bond.columns, SIZE_PX / bond.rows
    edge = np.minimum(np.minimum(fu, 1 - fu) * wide, np.minimum(fv, 1 - fv) * high)
    body = smoothstep(0.35 * bond.joint_px, 0.75 * bond.joint_px, edge)
    shape = (bond.rows, bond.columns)
    index = (row % bond.rows, column % bond.columns)
    tone = np.asarray(rng.uniform(0.0, 1.0, shape)[index], np.float32)
    slant = 0.05 * (rng.normal(size=shape)[index] * (fu - 0.5) + rng.normal(size=shape)[index] * fv)
    rounding = 1.0 - 0.22 * smoothstep(2.6 * bond.joint_px, 0.5 * bond.joint_px, edge)
    clouds = 0.5 * noise(rng, slope=1.2, band=(4.0, 40.0))
    face = 1.0 + slant + bond.grain * (noise(rng, slope=0.5, band=(12.0, 256.0)) + clouds)
    mortar = shaded(bond.joint, 1.0 + 0.06 * noise(rng, slope=0.4, band=(20.0, 256.0)))
    return blend(mortar, shaded(ramp(tone, bond.tones), face * rounding), body)


def herringbone(rng: np.random.Generator, colours: Sequence[Colour]) -> Float32Array:
    """Parquet of blocks of 1 x 5, 40 widths to the image of 1024 px."""
    size, units, long = 2 * SIZE_PX, 40, 5
    board = textures.wood(rng, colours)
    y, x = np.mgrid[0:size, 0:size].astype(np.float32) * (units / size)
    i, j = np.floor(x).astype(int), np.floor(y).astype(int)
    step = (i - j) % (2 * long)
    lies = step < long
    first_i = np.where(lies, i - step, i) % units
    first_j = np.where(lies, j, j - (2 * long - 1 - step)) % units
    along = np.where(lies, x - i + step, y - j + 2 * long - 1 - step)
    across = np.where(lies, y - j, x - i)
    cut = rng.integers(0, SIZE_PX, (2, units, units))[:, first_j, first_i]
    at = ((across * 20).astype(int) + cut[0]) % SIZE_PX, ((along * 30).astype(int) + cut[1])
    tone = np.clip(rng.normal(1.0, 0.09, (units, units)), 0.75, 1.2)[first_j, first_i]
    edge = np.minimum(np.minimum(across, 1 - across), np.minimum(along, long - along))
    gap = 1.0 - 0.5 * smoothstep(0.07, 0.025, edge)
    return shaded(board[at[0], at[1] % SIZE_PX], np.where(lies, 1.0, 0.93) * tone * gap)


def scattered(
    rng: np.random.Generator,
    ground: Float32Array,
    outline: FloatArray,
    count: int,
    colours: Sequence[Colour],
) -> Float32Array:
    """Strew shapes over a ground (H, W, 3): an outline (K, 2), px, turned and scaled anyhow.

    Later shapes lie on earlier ones and are brighter, as what is on top gets more light.
    """
    image = textures.pixels(ground)
    height, width = image.shape[:2]
    reach = 1.4 * float(np.abs(outline).max())
    for k in range(count):
        angle, scale = rng.uniform(0, 2 * np.pi), rng.uniform(0.6, 1.25)
        R = scale * np.array([[np.cos(angle), -np.sin(angle)], [np.sin(angle), np.cos(angle)]])
        at = rng.uniform((0, 0), (width, height))
        light = (0.72 + 0.28 * k / count) * rng.uniform(0.88, 1.08)
        tone = np.array(colours[int(rng.integers(len(colours)))])
        colour = np.rint(255 * np.clip(tone * light, 0, 1))
        for shift_x in _wraps(at[0], reach, width):
            for shift_y in _wraps(at[1], reach, height):
                points = (outline @ R.T + at + [shift_x, shift_y]) * 16
                polygon = np.rint(points).astype(np.int32)
                cv2.fillConvexPoly(image, polygon, colour.tolist(), cv2.LINE_AA, 4)
    return textures.floats(image)


def _wraps(at: float, reach: float, size: int) -> list[int]:
    """Shifts by which a shape must be drawn again to repeat across an edge."""
    return [0, *([size] if at < reach else []), *([-size] if at > size - reach else [])]


def terrazzo(rng: np.random.Generator, ground: Colour) -> Float32Array:
    """Polished chips of stone in cement."""
    base = shaded(ground, 1.0 + 0.03 * noise(rng, slope=0.8, band=(3.0, 200.0)))
    chip = np.array([(-6, -3), (-2, -5), (5, -4), (6, 1), (2, 5), (-4, 4)], np.float64)
    tones = [(0.86, 0.83, 0.78), (0.55, 0.50, 0.46), (0.35, 0.34, 0.34), (0.70, 0.55, 0.44)]
    small = scattered(rng, base, 0.5 * chip, 900, tones)
    return scattered(rng, small, chip, 420, tones)


def chipboard(rng: np.random.Generator) -> Float32Array:
    """Board of pressed wood strands."""
    base = shaded((0.66, 0.50, 0.30), 1.0 + 0.05 * noise(rng, slope=0.6))
    strand = np.array([(-26, -4), (20, -5), (28, 1), (15, 5), (-24, 4)], np.float64)
    tones = [(0.80, 0.64, 0.42), (0.72, 0.55, 0.33), (0.86, 0.72, 0.50), (0.62, 0.45, 0.26)]
    image = scattered(rng, base, strand, 900, tones)
    return shaded(image, 1.0 + 0.05 * noise(rng, slope=0.4, band=(20.0, 256.0)))


def gravel(rng: np.random.Generator) -> Float32Array:
    """Rounded pebbles on earth."""
    base = shaded((0.34, 0.29, 0.23), 1.0 + 0.15 * noise(rng, slope=0.6))
    angle = np.linspace(0, 2 * np.pi, 9)[:-1]
    pebble = np.stack([8 * np.cos(angle), 6 * np.sin(angle)], 1)
    tones = [(0.66, 0.62, 0.56), (0.52, 0.48, 0.43), (0.74, 0.70, 0.63), (0.45, 0.40, 0.36)]
    return scattered(rng, base, pebble, 2200, tones)


def ivy(rng: np.random.Generator, green: Colour) -> Float32Array:
    """Leaves upon leaves, as on an overgrown wall."""
    base = shaded(textures.brightened(green, 0.35), 1.0 + 0.2 * noise(rng, slope=0.7))
    leaf = np.array([(-11, 0), (-6, -7), (0, -9), (8, -5), (13, 0), (8, 5), (0, 9), (-6, 7)])
    tones = [textures.brightened(green, factor) for factor in (0.75, 0.95, 1.15, 1.35)]
    image = scattered(rng, base, leaf.astype(np.float64), 2600, tones)
    return shaded(image, 1.0 + 0.06 * noise(rng, slope=0.5, band=(16.0, 256.0)))


def marble(rng: np.random.Generator, ground: Colour, vein: Colour) -> Float32Array:
    """Polished stone with veins."""
    image = shaded(ground, 1.0 + 0.04 * noise(rng, slope=1.3, band=(2.0, 60.0)))
    for sharp, strength in ((0.10, 0.75), (0.05, 0.5), (0.22, 0.25)):
        field = noise(rng, slope=1.6, band=(1.0, 24.0))
        shift = noise(rng, slope=1.7, band=(1.0, 14.0)), noise(rng, slope=1.7, band=(1.0, 14.0))
        line = np.exp(-((textures.warped(field, 26 * shift[0], 26 * shift[1]) / sharp) ** 2))
        fading = smoothstep(-0.6, 1.2, noise(rng, slope=1.6, band=(1.0, 8.0)))
        image = blend(image, vein, (strength * line * fading).astype(np.float32))
    return image


def concrete(rng: np.random.Generator, colour: Colour) -> Float32Array:
    """Screed or cast concrete: clouds, pores, stains and a few cracks."""
    clouds = noise(rng, slope=1.7, band=(1.0, 24.0))
    grain = noise(rng, slope=0.4, band=(24.0, 256.0))
    pores = smoothstep(1.9, 2.7, noise(rng, slope=0.3, band=(40.0, 256.0)))
    stains = smoothstep(1.0, 2.2, noise(rng, slope=1.5, band=(2.0, 30.0)))
    wander = noise(rng, slope=1.4, band=(1.0, 60.0))
    cracks = smoothstep(0.012, 0.004, np.abs(wander)) * smoothstep(0.3, 1.2, clouds)
    light = 1.0 + 0.07 * clouds + 0.03 * grain - 0.2 * pores - 0.16 * stains - 0.35 * cracks
    return shaded(colour, light)


def pegboard(rng: np.random.Generator, colour: Colour) -> Float32Array:
    """Painted board with a grid of holes, 20 x 20 to the image."""
    x, y = textures.coordinates()
    hole = smoothstep(0.17, 0.12, np.hypot((x * 20) % 1 - 0.5, (y * 20) % 1 - 0.5))
    image = textures.paint(rng, colour)
    return blend(image, (0.10, 0.09, 0.08), 0.85 * hole)


def wainscot(rng: np.random.Generator, colour: Colour) -> Float32Array:
    """Tongue-and-groove boarding, upright, 12 boards to the image."""
    x, _ = textures.coordinates()
    u = (x * 12) % 1
    groove = 1.0 - 0.35 * smoothstep(0.05, 0.015, np.minimum(u, 1 - u))
    tone = rng.normal(1.0, 0.015, 12)[np.floor(x * 12).astype(int)]
    brush = noise(rng, slope=0.6, band=(4.0, 200.0), stretch=(1.0, 8.0))
    return shaded(colour, groove * tone * (1.0 + 0.03 * brush))


def roof_tiles(rng: np.random.Generator) -> Float32Array:
    """Rows of clay pantiles, lower edge of each row in shadow."""
    rows, columns = 8, 10
    y, x = np.mgrid[0:SIZE_PX, 0:SIZE_PX].astype(np.float32) / SIZE_PX
    row, column = np.floor(y * rows).astype(int), np.floor(x * columns).astype(int)
    tone = rng.uniform(0.0, 1.0, (rows, columns))[row, column].astype(np.float32)
    colour = ramp(tone, [(0.48, 0.22, 0.15), (0.66, 0.34, 0.22), (0.74, 0.46, 0.32)])
    bulge = 0.62 + 0.5 * np.sin(np.pi * ((x * columns) % 1.0)) ** 0.8
    drop = 0.55 + 0.5 * smoothstep(0.0, 0.25, (y * rows) % 1.0)
    return shaded(colour, bulge * drop * (1 + 0.10 * noise(rng, slope=0.7, band=(6.0, 256.0))))
