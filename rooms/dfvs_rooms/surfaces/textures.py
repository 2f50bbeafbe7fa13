"""Materials drawn with numpy alone: noise, plaster, bricks, wood, cloth.

Every function returns (H, W, 3) float32 sRGB in 0 to 1. Those of materials repeat without a seam,
because their noise is made in the frequency domain.
"""

from collections.abc import Sequence
from typing import Any

import cv2
import numpy as np
from numpy.typing import NDArray

from dfvs_core.geometry.arrays import Float32Array, ImageArray

SIZE_PX = 512
Colour = tuple[float, float, float]


def noise(
    rng: np.random.Generator,
    shape: tuple[int, int] = (SIZE_PX, SIZE_PX),
    *,
    slope: float = 1.5,
    band: tuple[float, float] = (2.0, 256.0),
    stretch: tuple[float, float] = (1.0, 1.0),
) -> Float32Array:
    """Periodic noise (H, W), mean 0 and deviation 1, amplitude ~ frequency ** -slope in a band.

    ``band`` is in cycles per image, ``stretch`` lengthens the structures along (x, y).
    """
    height, width = shape
    fy = np.fft.fftfreq(height, 1.0 / height)[:, None] * stretch[1]
    fx = np.fft.rfftfreq(width, 1.0 / width)[None, :] * stretch[0]
    f = np.hypot(fx, fy)
    inside = (f >= band[0]) & (f <= band[1])
    amplitude = np.where(inside, np.maximum(f, 1e-6) ** -slope, 0.0)
    phase = rng.uniform(0.0, 2.0 * np.pi, f.shape)
    field = np.fft.irfft2(amplitude * np.exp(1j * phase), s=shape)
    field = (field - field.mean()) / max(float(field.std()), 1e-12)
    return np.asarray(field, dtype=np.float32)


def coordinates(
    shape: tuple[int, int] = (SIZE_PX, SIZE_PX),
) -> tuple[Float32Array, Float32Array]:
    """Positions x and y (H, W) of pixel centres, 0 to 1, y downwards."""
    y, x = np.mgrid[0 : shape[0], 0 : shape[1]].astype(np.float32)
    return (x + 0.5) / shape[1], (y + 0.5) / shape[0]


def warped(field: Float32Array, dx: Float32Array, dy: Float32Array) -> Float32Array:
    """Field (H, W[, C]) looked up at shifted places; dx, dy (H, W) px; repeats at the edges."""
    height, width = field.shape[:2]
    y, x = np.mgrid[0:height, 0:width].astype(np.float32)
    out = cv2.remap(
        field,
        np.mod(x + dx, width).astype(np.float32),
        np.mod(y + dy, height).astype(np.float32),
        cv2.INTER_LINEAR,
        borderMode=cv2.BORDER_WRAP,
    )
    return np.asarray(out, dtype=np.float32)


def ramp(t: Float32Array, colours: Sequence[Colour]) -> Float32Array:
    """Colour (..., 3) of t (...) in 0 to 1 along evenly spaced colours."""
    at = np.linspace(0.0, 1.0, len(colours))
    stops = np.array(colours)
    return np.stack([np.interp(t, at, stops[:, k]) for k in range(3)], -1).astype(np.float32)


def smoothstep(low: float, high: float, x: NDArray[np.floating[Any]]) -> Float32Array:
    """0 below low, 1 above high, smooth between."""
    t = np.clip((x - low) / (high - low), 0.0, 1.0)
    return np.asarray(t * t * (3.0 - 2.0 * t), dtype=np.float32)


def blend(
    under: Float32Array | Colour, over: Float32Array | Colour, mask: Float32Array
) -> Float32Array:
    """Put ``over`` on ``under`` where mask (H, W) is 1; each an image (H, W, 3) or one colour."""
    m = mask[..., None]
    mixed = np.asarray(under, np.float32) * (1.0 - m) + np.asarray(over, np.float32) * m
    return np.asarray(mixed, dtype=np.float32)


def shaded(colour: Float32Array | Colour, light: Float32Array) -> Float32Array:
    """Colour (H, W, 3), or one for all, times light (H, W), cut to 0 to 1."""
    product = np.asarray(colour, np.float32) * np.asarray(light, np.float32)[..., None]
    return np.asarray(np.clip(product, 0.0, 1.0), dtype=np.float32)


def halved(image: Float32Array) -> Float32Array:
    """Image (H, W, 3) at half the size, averaged; repeats as before."""
    height, width = image.shape[:2]
    mean = image.reshape(height // 2, 2, width // 2, 2, 3).mean(axis=(1, 3))
    return np.asarray(mean, dtype=np.float32)


def pixels(image: Float32Array) -> ImageArray:
    """Image as uint8 RGB."""
    return np.asarray(np.rint(np.clip(image, 0.0, 1.0) * 255.0), dtype=np.uint8)


def floats(image: ImageArray) -> Float32Array:
    """Image of uint8 as 0 to 1."""
    return (image / np.float32(255.0)).astype(np.float32)


def brightened(colour: Colour, factor: float) -> Colour:
    """Colour times a factor, cut at 1."""
    r, g, b = (min(1.0, factor * c) for c in colour)
    return r, g, b


def plaster(rng: np.random.Generator, colour: Colour, contrast: float = 1.0) -> Float32Array:
    """Roughcast paint: fine stipple, short trowel strokes and faint clouds."""
    clouds = noise(rng, slope=1.6, band=(2.0, 10.0))
    strokes = noise(rng, slope=0.8, band=(10.0, 120.0), stretch=(1.0, 2.2))
    shift = noise(rng, band=(3.0, 12.0))
    strokes = warped(strokes, 9.0 * shift, -9.0 * shift)
    stipple = noise(rng, slope=0.35, band=(24.0, 200.0))
    pits = smoothstep(1.8, 2.6, noise(rng, slope=0.4, band=(16.0, 120.0)))
    light = 1.0 + contrast * (0.010 * clouds + 0.026 * strokes + 0.032 * stipple - 0.10 * pits)
    return shaded(colour, light)


def bricks(rng: np.random.Generator) -> Float32Array:
    """Old brickwork, 4 bricks by 12 courses to the image."""
    rows, columns = 12, 4
    y, x = np.mgrid[0:SIZE_PX, 0:SIZE_PX].astype(np.float32)
    x += 2.2 * noise(rng, slope=1.2, band=(4.0, 60.0))
    y += 1.6 * noise(rng, slope=1.2, band=(4.0, 60.0))
    row = np.floor(y / SIZE_PX * rows).astype(int)
    u = x / SIZE_PX * columns + 0.5 * (row % 2)
    column = np.floor(u).astype(int)
    inside_x, inside_y = u - np.floor(u), y / SIZE_PX * rows - row
    edge = np.minimum(
        np.minimum(inside_x, 1 - inside_x) * 128.0, np.minimum(inside_y, 1 - inside_y) * 42.7
    )
    body = smoothstep(1.8, 4.6, edge)
    shade = rng.uniform(0.0, 1.0, (rows, columns))[row % rows, column % columns]
    colour = ramp(
        shade.astype(np.float32),
        [
            (0.42, 0.20, 0.15), (0.58, 0.29, 0.21), (0.66, 0.37, 0.27), (0.55, 0.36, 0.29),
            (0.72, 0.47, 0.36),
        ],
    )  # fmt: skip
    grain = (
        1 + 0.10 * noise(rng, slope=0.7, band=(8.0, 256.0)) + 0.08 * noise(rng, band=(2.0, 16.0))
    )
    mortar = (
        np.array([0.66, 0.63, 0.58]) * (1 + 0.06 * noise(rng, slope=0.4, band=(20, 256)))[..., None]
    )
    return blend(mortar.astype(np.float32), (colour * grain[..., None]).astype(np.float32), body)


def wood(rng: np.random.Generator, colours: Sequence[Colour], rings: float = 9.0) -> Float32Array:
    """Sawn wood with its grain along x."""
    flow = noise(rng, slope=1.8, band=(1.0, 24.0), stretch=(5.0, 1.0))
    y = np.mgrid[0:SIZE_PX, 0:SIZE_PX][0] / SIZE_PX
    phase = rings * (y + 0.10 * flow)
    ring = 0.5 + 0.5 * np.sin(2 * np.pi * np.round(rings) / rings * phase)
    fibres = noise(rng, slope=0.5, band=(20.0, 256.0), stretch=(9.0, 1.0))
    pores = smoothstep(1.3, 2.2, noise(rng, slope=0.2, band=(40.0, 256.0), stretch=(14.0, 1.0)))
    t = np.clip(0.25 + 0.45 * ring**1.6 + 0.11 * fibres, 0.0, 1.0).astype(np.float32)
    return (ramp(t, colours) * (1.0 - 0.30 * pores[..., None])).astype(np.float32)


OAK: tuple[Colour, ...] = ((0.78, 0.60, 0.40), (0.70, 0.50, 0.31), (0.56, 0.38, 0.22))
WALNUT: tuple[Colour, ...] = ((0.50, 0.34, 0.23), (0.40, 0.26, 0.17), (0.27, 0.17, 0.11))


def planks(rng: np.random.Generator) -> Float32Array:
    """Oak floor, planks along x, each cut from another place of the tree."""
    count, size = 12, 2 * SIZE_PX
    board = np.tile(wood(rng, OAK), (2, 4, 1))
    out = np.empty((size, size, 3), np.float32)
    for k in range(count):
        y0, y1 = k * size // count, (k + 1) * size // count
        ends = np.sort(rng.integers(0, size, 2))
        ends[1] = ends[0] + np.clip(ends[1] - ends[0], size // 3, 2 * size // 3)
        for a, b in ((ends[0], ends[1]), (ends[1], ends[0] + size)):
            dy, dx = rng.integers(0, SIZE_PX, 2)
            flip = 1 if rng.random() < 0.5 else -1
            piece = board[dy : dy + 2 * (y1 - y0) : 2][: y1 - y0][::flip]
            columns = np.arange(a, b) % size
            tone = np.clip(rng.normal(1.0, 0.09), 0.8, 1.16) * np.array(
                [1.0, rng.normal(1.0, 0.02), rng.normal(0.98, 0.04)]
            )
            out[y0:y1, columns] = piece[:, dx : dx + b - a] * tone
            out[y0:y1, [a % size, (a + 1) % size]] *= 0.45
        out[y0] *= 0.40
        out[y0 + 1] *= 0.75
        out[y1 - 1] *= 0.85
    return np.clip(out, 0.0, 1.0)


def cloth(rng: np.random.Generator, colour: Colour, threads: int = 96) -> Float32Array:
    """Coarse woven cloth with worn and felted places."""
    y, x = np.mgrid[0:SIZE_PX, 0:SIZE_PX].astype(np.float32) * (2 * np.pi * threads / SIZE_PX)
    weave = np.sin(x) * np.cos(y) + 0.6 * np.sin(x) * np.sin(y)
    slubs = noise(rng, slope=0.4, band=(8.0, 200.0), stretch=(7.0, 1.0)) + noise(
        rng, slope=0.4, band=(8.0, 200.0), stretch=(1.0, 7.0)
    )
    clouds = noise(rng, slope=1.4, band=(2.0, 30.0))
    light = 1.0 + 0.06 * weave + 0.075 * slubs + 0.055 * clouds
    return shaded(colour, light)


def paint(rng: np.random.Generator, colour: Colour) -> Float32Array:
    """Painted wood or metal with faint brush marks and scuffs."""
    marks = noise(rng, slope=0.6, band=(4.0, 200.0), stretch=(8.0, 1.0))
    scuffs = smoothstep(1.6, 2.6, noise(rng, slope=0.8, band=(6.0, 120.0)))
    light = 1.0 + 0.020 * marks + 0.02 * noise(rng, band=(2.0, 20.0)) - 0.08 * scuffs
    return shaded(colour, light)


def earthenware(rng: np.random.Generator, colour: Colour) -> Float32Array:
    """Unglazed clay with turning rings."""
    rings = noise(rng, slope=0.6, band=(6.0, 90.0), stretch=(30.0, 1.0))
    grain = noise(rng, slope=0.5, band=(8.0, 256.0))
    light = 1.0 + 0.05 * rings + 0.07 * grain
    return shaded(colour, light)


def foliage(rng: np.random.Generator, colour: Colour) -> Float32Array:
    """Leaf along y with a midrib and side veins."""
    y, x = np.mgrid[0:SIZE_PX, 0:SIZE_PX].astype(np.float32) / SIZE_PX
    rib = np.exp(-(((x - 0.5) / 0.025) ** 2))
    slant = (y * 9.0 - np.abs(x - 0.5) * 5.0) % 1.0
    veins = np.exp(-(((slant - 0.5) / 0.09) ** 2))
    mottle = noise(rng, slope=1.0, band=(3.0, 80.0))
    light = 0.86 + 0.40 * rib + 0.20 * veins + 0.10 * mottle
    return shaded(colour, light)


def wicker(rng: np.random.Generator) -> Float32Array:
    """Basketwork."""
    y, x = np.mgrid[0:SIZE_PX, 0:SIZE_PX].astype(np.float32) / SIZE_PX
    rows, posts = 24, 16
    over = (np.floor(y * rows) + np.floor(x * posts)) % 2
    strand = np.sin(np.pi * ((y * rows) % 1.0)) ** 0.6
    bulge = np.where(over > 0, np.sin(np.pi * ((x * posts) % 1.0)), 0.45)
    light = strand * (0.45 + 0.6 * bulge) * (1 + 0.12 * noise(rng, slope=0.5, band=(8.0, 200.0)))
    return shaded((0.74, 0.56, 0.35), light)
