"""Artworks that hang or stand in a room: paintings, book spines, a dial, the view outside."""

import itertools

import numpy as np

from dfvs_core.geometry.arrays import Float32Array
from dfvs_rooms.surfaces.textures import (
    SIZE_PX,
    blend,
    coordinates,
    noise,
    ramp,
    shaded,
    smoothstep,
    warped,
)

SPINES = 24
"""Books in an image of spines."""


def landscape(rng: np.random.Generator, shape: tuple[int, int] = (288, 384)) -> Float32Array:
    """Hills behind hills under an evening sky."""
    x, y = coordinates(shape)
    image = ramp(
        y * 1.5, [(0.20, 0.30, 0.52), (0.62, 0.55, 0.62), (0.96, 0.74, 0.50), (0.98, 0.86, 0.62)]
    )
    cx, cy = rng.uniform(0.3, 0.7), rng.uniform(0.36, 0.44)
    sun = np.hypot((x - cx) * 1.33, y - cy)
    image = blend(image, (1.0, 0.95, 0.78), smoothstep(0.062, 0.055, sun))
    clouds = smoothstep(
        0.4, 1.6, noise(rng, shape, slope=1.2, band=(2.0, 60.0), stretch=(3.5, 1.0))
    )
    image = blend(image, (0.98, 0.80, 0.72), 0.7 * clouds * (y < 0.5))
    for k in range(5):
        ridge = noise(rng, (1, shape[1] * 2), slope=1.3, band=(1.0, 80.0))[0, : shape[1]]
        line = 0.46 + 0.11 * k + 0.035 * ridge
        t = k / 4
        shade = np.array((0.46, 0.48, 0.60)) * (1 - t) + np.array((0.10, 0.20, 0.12)) * t
        texture = 1 + 0.18 * t * noise(rng, shape, slope=0.6, band=(10.0, 200.0))
        hill = (shade * texture[..., None]).astype(np.float32)
        image = blend(image, hill, smoothstep(-0.003, 0.003, y - line))
    return _canvas(rng, image)


def rectangles(rng: np.random.Generator, shape: tuple[int, int] = (384, 288)) -> Float32Array:
    """Black lines and a few coloured fields."""
    image = np.full((*shape, 3), (0.93, 0.91, 0.86), np.float32)
    xs = np.sort(rng.choice(np.arange(1, 12), 4, replace=False)) * shape[1] // 12
    ys = np.sort(rng.choice(np.arange(1, 14), 5, replace=False)) * shape[0] // 14
    xs, ys = np.r_[0, xs, shape[1]], np.r_[0, ys, shape[0]]
    palette = [
        (0.80, 0.12, 0.10), (0.08, 0.22, 0.55), (0.95, 0.78, 0.15), (0.1, 0.1, 0.1),
        (0.75, 0.74, 0.7),
    ]  # fmt: skip
    for j in range(len(ys) - 1):
        for i in range(len(xs) - 1):
            if rng.random() < 0.45:
                colour = palette[rng.integers(len(palette))]
                image[ys[j] : ys[j + 1], xs[i] : xs[i + 1]] = colour
    for x in xs[1:-1]:
        image[:, x - 3 : x + 3] = 0.06
    for y in ys[1:-1]:
        image[y - 3 : y + 3] = 0.06
    return _canvas(rng, image)


def contours(rng: np.random.Generator, shape: tuple[int, int] = (288, 384)) -> Float32Array:
    """Topographic map with water, paths and names left out."""
    height = noise(rng, shape, slope=2.0, band=(1.0, 40.0))
    t = np.clip((height + 2.2) / 4.4, 0, 1)
    image = ramp(
        t,
        [
            (0.42, 0.62, 0.70), (0.60, 0.76, 0.76), (0.80, 0.86, 0.68), (0.90, 0.82, 0.62),
            (0.78, 0.62, 0.48), (0.95, 0.94, 0.92),
        ],
    )  # fmt: skip
    step = (height * 5.0) % 1.0
    slope = np.hypot(*np.gradient(height)) * 5.0
    line = smoothstep(1.6, 0.8, np.minimum(step, 1 - step) / np.maximum(slope, 1e-3))
    image = blend(image, (0.35, 0.24, 0.18), 0.75 * line)
    x, y = coordinates(shape)
    grid = np.minimum(np.abs((x * 8) % 1 - 0.5), np.abs((y * 6) % 1 - 0.5))
    return _canvas(rng, blend(image, (0.3, 0.35, 0.5), 0.6 * smoothstep(0.012, 0.006, grid)))


def swirls(rng: np.random.Generator, shape: tuple[int, int] = (384, 384)) -> Float32Array:
    """Marbled abstract."""
    field = noise(rng, shape, slope=1.7, band=(1.0, 24.0))
    for strength in (60.0, 40.0):
        dx, dy = (
            noise(rng, shape, slope=1.8, band=(1.0, 12.0)),
            noise(rng, shape, slope=1.8, band=(1.0, 12.0)),
        )
        field = warped(field, strength * dx, strength * dy)
    t = (0.5 + 0.5 * np.sin(4.2 * field)).astype(np.float32)
    hues = [
        (0.07, 0.13, 0.25), (0.10, 0.38, 0.45), (0.85, 0.80, 0.66), (0.84, 0.45, 0.22),
        (0.42, 0.10, 0.14),
    ]  # fmt: skip
    return _canvas(rng, ramp(t, hues))


def city(rng: np.random.Generator, shape: tuple[int, int] = (288, 384)) -> Float32Array:
    """Skyline at dusk with lit windows over water."""
    height, width = shape
    _, y = coordinates(shape)
    image = ramp(
        y * 1.4, [(0.07, 0.08, 0.22), (0.25, 0.20, 0.42), (0.72, 0.38, 0.42), (0.95, 0.66, 0.40)]
    )
    horizon = int(0.72 * height)
    for layer in range(3):
        at = 0
        while at < width:
            w, h = int(rng.integers(14, 40)), int(rng.integers(38, 145) * (1 - 0.2 * layer))
            tone = np.array((0.16, 0.15, 0.26)) * (1.5 - 0.45 * layer)
            image[horizon - h : horizon, at : at + w] = tone
            for wy in range(horizon - h + 6, horizon - 6, 9):
                for wx in range(at + 4, min(at + w, width) - 6, 8):
                    if rng.random() < 0.4:
                        image[wy : wy + 4, wx : wx + 4] = (0.98, rng.uniform(0.7, 0.9), 0.45)
            at += w + int(rng.integers(0, 14))
    mirror = image[horizon - (height - horizon) : horizon][::-1] * 0.6
    image[horizon:] = mirror[: height - horizon]
    ripple = 3.0 * noise(rng, shape, slope=0.6, band=(8.0, 100.0), stretch=(6.0, 1.0)) * (y > 0.72)
    return _canvas(rng, warped(image, ripple.astype(np.float32), 0.0 * ripple))


def botanical(rng: np.random.Generator, shape: tuple[int, int] = (384, 288)) -> Float32Array:
    """Fern pressed on old paper."""
    x, y = coordinates(shape)
    image = np.full((*shape, 3), (0.92, 0.88, 0.76), np.float32)
    image *= (1 + 0.03 * noise(rng, shape, slope=1.0, band=(2.0, 60.0)))[..., None]
    bend = float(rng.uniform(-0.12, 0.12))
    for k in range(13):
        t = 0.14 + 0.055 * k
        sx, sy = 0.5 + bend * (1 - t) ** 2, t
        for side in (-1.0, 1.0):
            length = 0.30 * np.sin(np.pi * min(1.0, 0.25 + 0.055 * k)) + 0.04
            dx, dy = (x - sx) * side, (y - sy) + 0.45 * np.abs(x - sx)
            u = dx / length
            half = 0.020 * np.clip(1 - u, 0, 1) * (1 + 0.35 * np.cos(60 * u))
            leaf = smoothstep(0.003, -0.003, np.abs(dy) - half) * (u > 0) * (u < 1)
            tone = np.array((0.16, 0.34, 0.20)) * rng.uniform(0.8, 1.3)
            image = blend(image, (float(tone[0]), float(tone[1]), float(tone[2])), leaf)
    stem = np.abs(x - 0.5 - bend * (1 - y) ** 2) - 0.004
    image = blend(
        image, (0.25, 0.30, 0.16), smoothstep(0.003, -0.003, stem) * (y > 0.1) * (y < 0.93)
    )
    return _canvas(rng, image)


def painting(rng: np.random.Generator) -> Float32Array:
    """Any of the paintings above."""
    painters = (landscape, rectangles, contours, swirls, city, botanical)
    return painters[int(rng.integers(len(painters)))](rng)


def _canvas(rng: np.random.Generator, image: Float32Array) -> Float32Array:
    """Add the grain of paint on canvas."""
    shape = image.shape[:2]
    grain = (
        1
        + 0.05 * noise(rng, shape, slope=0.5, band=(10.0, 256.0))
        + 0.03 * noise(rng, shape, slope=1.2)
    )
    return shaded(image, grain)


def book_spines(rng: np.random.Generator) -> Float32Array:
    """Spines of ``SPINES`` books side by side, with bands and lettering."""
    height, width = SIZE_PX // 2, 2 * SIZE_PX
    image = np.zeros((height, width, 3), np.float32)
    bounds = np.linspace(0, width, SPINES + 1).astype(int)
    hues = np.array(
        [
            (0.45, 0.10, 0.10), (0.10, 0.20, 0.38), (0.12, 0.32, 0.22), (0.80, 0.72, 0.55),
            (0.15, 0.14, 0.15), (0.62, 0.38, 0.14), (0.52, 0.50, 0.46), (0.30, 0.14, 0.30),
            (0.85, 0.84, 0.80), (0.70, 0.25, 0.12),
        ]
    )  # fmt: skip
    for a, b in itertools.pairwise(bounds):
        base = np.clip(hues[rng.integers(len(hues))] * rng.uniform(0.8, 1.2), 0, 1)
        image[:, a:b] = base
        ink = np.array((0.90, 0.78, 0.45)) if base.mean() < 0.5 else np.array((0.16, 0.12, 0.12))
        for band in rng.choice([0.08, 0.14, 0.22, 0.72, 0.80, 0.90], 3, replace=False):
            row = int(band * height)
            image[row : row + int(rng.integers(2, 7)), a:b] = ink
        x, at = (a + b) // 2, int(0.28 * height)
        while at < 0.66 * height:
            letter = int(rng.integers(3, 8))
            half = int(rng.integers(3, max(4, (b - a) // 3)))
            if rng.random() < 0.85:
                image[at : at + letter, x - half : x + half] = ink
            at += letter + int(rng.integers(2, 5))
        u = np.abs(np.linspace(-1, 1, b - a))
        image[:, a:b] *= (1 - 0.45 * u**4)[None, :, None]
    grain = 1 + 0.06 * noise(rng, (height, width), slope=0.6, band=(8.0, 300.0))
    return shaded(image, grain)


def clock_face(rng: np.random.Generator) -> Float32Array:
    """Dial with twelve marks and two hands."""
    x, y = coordinates((SIZE_PX // 2, SIZE_PX // 2))
    dx, dy = 2 * x - 1, 2 * y - 1
    r, angle = np.hypot(dx, dy), np.arctan2(dx, -dy)
    image = np.full((*x.shape, 3), (0.95, 0.93, 0.87), np.float32)
    image *= (1 + 0.02 * noise(rng, x.shape, slope=0.8, band=(3.0, 100.0)))[..., None]
    tick = np.abs((angle / (2 * np.pi) * 12 + 0.5) % 1 - 0.5) * r < 0.05
    image = blend(image, (0.1, 0.1, 0.12), (tick & (r > 0.72) & (r < 0.9)).astype(np.float32))
    for hand, length, width in ((0.9, 0.5, 0.035), (4.1, 0.72, 0.022)):
        along, across = dx * np.sin(hand) - dy * np.cos(hand), dx * np.cos(hand) + dy * np.sin(hand)
        mask = (np.abs(across) < width) & (along > -0.12) & (along < length)
        image = blend(image, (0.1, 0.1, 0.12), mask.astype(np.float32))
    return blend(image, (0.2, 0.13, 0.08), (r > 0.94).astype(np.float32))


def garden(rng: np.random.Generator) -> Float32Array:
    """View out of the window: sky with clouds, far trees, a hedge and a lawn."""
    shape = (SIZE_PX, 2 * SIZE_PX)
    _, y = coordinates(shape)
    image = ramp(
        y * 1.6, [(0.40, 0.60, 0.88), (0.62, 0.78, 0.94), (0.86, 0.91, 0.95), (0.90, 0.92, 0.92)]
    )
    clouds = smoothstep(
        0.2, 1.6, noise(rng, shape, slope=1.3, band=(2.0, 80.0), stretch=(2.0, 1.0))
    )
    image = blend(image, (0.98, 0.98, 0.98), 0.9 * clouds * smoothstep(0.65, 0.35, y))
    lines = (
        (0.46, 0.05, (0.42, 0.52, 0.50)),
        (0.52, 0.07, (0.26, 0.40, 0.24)),
        (0.62, 0.03, (0.14, 0.27, 0.10)),
    )
    for level, rough, colour in lines:
        crown = noise(rng, (1, shape[1]), slope=0.9, band=(2.0, 160.0))[0]
        leaves = 1 + 0.30 * noise(rng, shape, slope=0.5, band=(12.0, 300.0))
        tree = (np.asarray(colour) * leaves[..., None]).astype(np.float32)
        image = blend(image, tree, smoothstep(-0.004, 0.004, y - (level - 0.6 * rough * crown)))
    grass = 1 + 0.22 * noise(rng, shape, slope=0.5, band=(20.0, 400.0), stretch=(0.6, 1.6))
    lawn = (np.array((0.36, 0.50, 0.20)) * grass[..., None]).astype(np.float32)
    return np.clip(blend(image, lawn, smoothstep(0.74, 0.76, y)), 0, 1).astype(np.float32)
