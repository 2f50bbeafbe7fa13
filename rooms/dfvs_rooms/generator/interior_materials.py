"""Materials of the drawn interiors: every room has walls, woods, cloths and paints of its own.

A material's name without its number is its kind: ``wall0`` and ``wall3`` are both walls. Over half
of all walls are plain, because that is where matching is hard.
"""

import colorsys
from collections.abc import Callable, Iterable
from typing import TypeAlias

import numpy as np

from dfvs_core.geometry.arrays import Float32Array
from dfvs_rooms.surfaces import artwork, patterns, textures
from dfvs_rooms.surfaces.materials import Drawn, Material, drawn_materials
from dfvs_rooms.surfaces.textures import SIZE_PX, Colour

_Recipe: TypeAlias = Callable[[np.random.Generator], Drawn]

FULL_SIZE = frozenset(("wall", "floor", "ceiling", "rug", "books", "picture", "screen"))


def interior_materials(names: Iterable[str], rng: np.random.Generator) -> dict[str, Material]:
    """Draw the named materials; a name's kind says how, the generator what comes of it.

    Raises
    ------
    KeyError
        If a name is of no known kind.
    """
    return drawn_materials(names, rng, lambda kind, stream: RECIPES[kind](stream), FULL_SIZE)


def drawn_colour(
    rng: np.random.Generator, value: tuple[float, float], saturation: tuple[float, float]
) -> Colour:
    """Colour of any hue, its brightest channel and saturation from the given ranges."""
    hue, s, v = rng.random(), rng.uniform(*saturation), rng.uniform(*value)
    return colorsys.hsv_to_rgb(float(hue), float(s), float(v))


def tiles(rng: np.random.Generator, colours: tuple[Colour, Colour], count: int) -> Float32Array:
    """Square tiles, count x count to the image, of two alternating colours, with joints."""
    x, y = textures.coordinates()
    column, row = np.floor(x * count).astype(int), np.floor(y * count).astype(int)
    dark = ((column + row) % 2).astype(np.float32)
    image = textures.blend(colours[0], colours[1], dark)
    tone = rng.normal(1.0, 0.04, (count, count))[row, column]
    inside = np.minimum(np.minimum(x * count % 1, 1 - x * count % 1), y * count % 1)
    inside = np.minimum(inside, 1 - y * count % 1)
    joint = 1.0 - 0.45 * textures.smoothstep(0.025, 0.012, inside)
    grain = 1.0 + 0.03 * textures.noise(rng, slope=0.8, band=(4.0, 200.0))
    return textures.shaded(image, tone * joint * grain)


def _tinted(rng: np.random.Generator, image: Float32Array, strength: float = 0.3) -> Float32Array:
    """Same image in another light: each channel takes a gain of its own."""
    gain = np.exp(rng.uniform(-strength, 0.4 * strength, 3))
    return np.asarray(np.clip(image * gain, 0.0, 1.0), np.float32)


def _wall(rng: np.random.Generator) -> Drawn:
    kind = rng.choice(6, p=[0.56, 0.14, 0.10, 0.07, 0.06, 0.07])
    colour = drawn_colour(rng, (0.35, 0.95), (0.0, 0.3))
    if kind == 0:
        return textures.plaster(rng, colour, contrast=float(rng.uniform(0.0, 0.35))), 1.6
    if kind == 1:
        return textures.plaster(rng, colour, contrast=float(rng.uniform(0.6, 1.6))), 1.3
    second = drawn_colour(rng, (0.25, 0.9), (0.0, 0.45))
    if kind == 2:
        return patterns.wallpaper(rng, colour, second), float(rng.uniform(0.4, 1.0))
    if kind == 3:
        return _tinted(rng, textures.bricks(rng), 0.5), float(rng.uniform(0.8, 1.2))
    if kind == 4:
        return patterns.pattern_cloth(rng, "stripes", colour, second), float(rng.uniform(0.6, 1.4))
    return tiles(rng, (colour, colour), int(rng.integers(4, 9))), 1.2


def _floor(rng: np.random.Generator) -> Drawn:
    kind = rng.choice(4, p=[0.4, 0.25, 0.2, 0.15])
    colour = drawn_colour(rng, (0.25, 0.8), (0.0, 0.3))
    if kind == 0:
        return _tinted(rng, textures.planks(rng), 0.6), float(rng.uniform(1.4, 2.2))
    if kind == 1:
        second = colour if rng.random() < 0.5 else drawn_colour(rng, (0.2, 0.9), (0.0, 0.3))
        return tiles(rng, (colour, second), int(rng.choice([2, 4, 6]))), float(rng.uniform(1, 2))
    if kind == 2:
        return textures.cloth(rng, colour), float(rng.uniform(0.5, 1.0))
    return textures.plaster(rng, colour, contrast=float(rng.uniform(0.3, 1.5))), 1.6


def _ceiling(rng: np.random.Generator) -> Drawn:
    colour = drawn_colour(rng, (0.8, 0.96), (0.0, 0.06))
    return textures.plaster(rng, colour, contrast=float(rng.uniform(0.0, 0.6))), 1.5


def _wood(rng: np.random.Generator) -> Drawn:
    colours = textures.OAK if rng.random() < 0.5 else textures.WALNUT
    return _tinted(rng, textures.wood(rng, colours), 0.6), float(rng.uniform(0.7, 1.1))


def _painted(value: tuple[float, float], saturation: tuple[float, float]) -> _Recipe:
    return lambda rng: (textures.paint(rng, drawn_colour(rng, value, saturation)), 0.6)


def _cloth(rng: np.random.Generator) -> Drawn:
    return textures.cloth(rng, drawn_colour(rng, (0.2, 0.85), (0.0, 0.6))), 0.55


def _print(rng: np.random.Generator) -> Drawn:
    kind = str(rng.choice(["chevron", "dots", "stripes", "ikat"]))
    first, second = (drawn_colour(rng, (0.15, 0.95), (0.05, 0.8)) for _ in range(2))
    return patterns.pattern_cloth(rng, kind, first, second), float(rng.uniform(0.45, 1.0))


def _clay(rng: np.random.Generator) -> Drawn:
    return textures.earthenware(rng, drawn_colour(rng, (0.25, 0.9), (0.2, 0.8))), 0.5


def _leaf(rng: np.random.Generator) -> Drawn:
    green = (0.12 + 0.2 * rng.random(), 0.32 + 0.25 * rng.random(), 0.1 + 0.15 * rng.random())
    return textures.foliage(rng, green), 1.0


def _carton(rng: np.random.Generator) -> Drawn:
    """Corrugated board with a strip of tape."""
    x, _ = textures.coordinates()
    image = textures.earthenware(rng, (0.68, 0.52, 0.34))
    tape = textures.smoothstep(0.06, 0.05, np.abs(x - 0.5))
    return textures.blend(image, (0.80, 0.70, 0.50), 0.8 * tape), 0.5


def _screen(rng: np.random.Generator) -> Drawn:
    """What a monitor shows: lines of text in a few windows."""
    x, y = textures.coordinates((SIZE_PX // 2, SIZE_PX))
    image = np.full((*x.shape, 3), drawn_colour(rng, (0.1, 0.3), (0.1, 0.6)), np.float32)
    for _ in range(3):
        left, top = rng.uniform(0.0, 0.6, 2)
        within = (x > left) & (x < left + 0.38) & (y > top) & (y < top + 0.35)
        image = textures.blend(image, (0.85, 0.86, 0.88), within.astype(np.float32))
        ends = rng.uniform(0.1, 0.34, 64)[(y * 64).astype(int) % 64]
        text = within & ((y * 64) % 1 < 0.5) & (x > left + 0.02) & (x < left + ends)
        image = textures.blend(image, (0.15, 0.15, 0.2), 0.8 * text.astype(np.float32))
    return image, 1.0


RECIPES: dict[str, _Recipe] = {
    "wall": _wall,
    "floor": _floor,
    "ceiling": _ceiling,
    **dict.fromkeys(("oak", "walnut"), _wood),
    **dict.fromkeys(("sage", "brass", "metal"), _painted((0.15, 0.92), (0.0, 0.5))),
    "white": _painted((0.8, 0.95), (0.0, 0.05)),
    "black": _painted((0.06, 0.2), (0.0, 0.2)),
    **dict.fromkeys(("sofa", "armchair", "linen"), _cloth),
    **dict.fromkeys(("ikat", "print", "drape", "kilim"), _print),
    **dict.fromkeys(("clay", "glaze", "earth", "orange", "apple"), _clay),
    **dict.fromkeys(("fern", "rubber"), _leaf),
    "wicker": lambda rng: (textures.wicker(rng), 0.5),
    "rug": lambda rng: (_tinted(rng, patterns.rug(rng), 0.8), 1.0),
    "books": lambda rng: (_tinted(rng, artwork.book_spines(rng)), 1.0),
    "clock": lambda rng: (artwork.clock_face(rng), 1.0),
    "picture": lambda rng: (_tinted(rng, artwork.painting(rng), 0.4), 1.0),
    "carton": _carton,
    "screen": _screen,
    "garden": lambda rng: (_tinted(rng, artwork.garden(rng)), 1.0),
    "globe": lambda _: (np.ones((8, 8, 3), np.float32), 1.0),
}
