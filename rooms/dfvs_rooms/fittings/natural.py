"""Materials of the places: each looks like one thing, in the colours of the place's palette.

As in ``interior_materials.py``, a material's name without its number is its kind.
"""

from collections.abc import Callable, Iterable
from dataclasses import dataclass
from typing import TypeAlias

import numpy as np

from dfvs_core.geometry.arrays import Float32Array
from dfvs_rooms.generator.interior_materials import FULL_SIZE, RECIPES
from dfvs_rooms.surfaces import artwork, finishes, patterns, prints, textures
from dfvs_rooms.surfaces.finishes import Bond
from dfvs_rooms.surfaces.materials import Drawn, Material, drawn_materials
from dfvs_rooms.surfaces.textures import OAK, WALNUT, Colour, brightened

BIRCH: tuple[Colour, ...] = ((0.87, 0.75, 0.57), (0.81, 0.67, 0.48), (0.70, 0.55, 0.37))
CHERRY: tuple[Colour, ...] = ((0.64, 0.38, 0.24), (0.55, 0.30, 0.18), (0.42, 0.21, 0.12))


@dataclass(frozen=True, slots=True)
class Palette:
    """Colours of one place."""

    walls: tuple[Colour, ...]
    wood: tuple[Colour, ...]
    """From the light to the dark of the wood that most furniture is of."""
    front: Colour
    """Painted doors and furniture."""
    cloth: Colour
    accent: Colour
    """Cushions, patterns, things to be noticed; ``cloth`` is upholstery."""


PALETTES = (
    Palette(
        ((0.90, 0.87, 0.80), (0.86, 0.82, 0.74)), OAK, (0.52, 0.60, 0.52), (0.36, 0.42, 0.46),
        (0.74, 0.42, 0.22),
    ),
    Palette(
        ((0.89, 0.89, 0.87), (0.72, 0.76, 0.78)), BIRCH, (0.24, 0.34, 0.44), (0.62, 0.60, 0.56),
        (0.82, 0.64, 0.22),
    ),
    Palette(
        ((0.91, 0.90, 0.87), (0.74, 0.78, 0.70)), WALNUT, (0.88, 0.87, 0.83), (0.44, 0.50, 0.40),
        (0.64, 0.26, 0.20),
    ),
    Palette(
        ((0.92, 0.88, 0.80), (0.84, 0.66, 0.52)), OAK, (0.76, 0.72, 0.64), (0.58, 0.34, 0.26),
        (0.16, 0.36, 0.40),
    ),
    Palette(
        ((0.90, 0.89, 0.86), (0.62, 0.66, 0.70)), CHERRY, (0.36, 0.40, 0.40), (0.24, 0.30, 0.40),
        (0.78, 0.50, 0.40),
    ),
    Palette(
        ((0.93, 0.91, 0.84), (0.88, 0.80, 0.58)), BIRCH, (0.40, 0.52, 0.56), (0.72, 0.66, 0.54),
        (0.50, 0.22, 0.30),
    ),
)  # fmt: skip

_Recipe: TypeAlias = Callable[[np.random.Generator, Palette], Drawn]

WALLS = ("wall", "bricks", "stone", "stucco", "wallpaper", "blockwork", "wainscot", "subway")
"""Kinds of materials that walls are of: their light sets the exposure."""


def natural_materials(names: Iterable[str], rng: np.random.Generator) -> dict[str, Material]:
    """Draw a palette and the named materials in it; the generator decides.

    Raises
    ------
    KeyError
        If a name is of no known kind.
    """
    palette = PALETTES[int(rng.integers(len(PALETTES)))]

    def draw(kind: str, stream: np.random.Generator) -> Drawn:
        recipe = _RECIPES.get(kind)
        return recipe(stream, palette) if recipe else RECIPES[kind](stream)

    return drawn_materials(names, rng, draw, _LARGE)


def _varied(rng: np.random.Generator, colour: Colour, spread: float = 0.04) -> Colour:
    r, g, b = np.clip(np.array(colour) * (1 + rng.uniform(-spread, spread, 3)), 0.0, 1.0)
    return float(r), float(g), float(b)


def _wall(rng: np.random.Generator, palette: Palette) -> Drawn:
    colour = palette.walls[int(rng.integers(len(palette.walls)))]
    return textures.plaster(rng, _varied(rng, colour, 0.015), float(rng.uniform(0.5, 1.1))), 1.4


def _painted(
    pick: Callable[[Palette], Colour], span_m: float = 0.8, spread: float = 0.04
) -> _Recipe:
    """Lacquered wood or metal: smoother than ``textures.paint``."""

    def draw(rng: np.random.Generator, palette: Palette) -> Drawn:
        marks = textures.noise(rng, slope=0.5, band=(6.0, 250.0), stretch=(6.0, 1.0))
        clouds = textures.noise(rng, slope=1.6, band=(1.0, 8.0))
        light = 1.0 + 0.014 * marks + 0.014 * clouds
        return textures.shaded(_varied(rng, pick(palette), spread), light), span_m

    return draw


def _clay(colour: Colour) -> _Recipe:
    return lambda rng, _: (textures.earthenware(rng, _varied(rng, colour, 0.08)), 0.5)


def _leaf(colour: Colour) -> _Recipe:
    return lambda rng, _: (textures.foliage(rng, _varied(rng, colour, 0.12)), 1.0)


def _shown(draw: Callable[[np.random.Generator], Float32Array], span_m: float = 1.0) -> _Recipe:
    return lambda rng, _: (draw(rng), span_m)


def _cloth(pick: Callable[[Palette], Colour]) -> _Recipe:
    """Woven cloth, less worn than ``textures.cloth``."""

    def draw(rng: np.random.Generator, palette: Palette) -> Drawn:
        colour = _varied(rng, pick(palette), 0.08)
        worn = textures.cloth(rng, colour)
        return (0.5 * worn + 0.5 * np.asarray(colour, np.float32)).astype(np.float32), 0.55

    return draw


def _printed(kinds: tuple[str, ...]) -> _Recipe:
    def draw(rng: np.random.Generator, palette: Palette) -> Drawn:
        kind = kinds[int(rng.integers(len(kinds)))]
        colours = (0.88, 0.85, 0.77), _varied(rng, palette.accent, 0.15)
        return patterns.pattern_cloth(rng, kind, *colours), float(rng.uniform(0.5, 0.8))

    return draw


def _laid(bond: Bond, span_m: float) -> _Recipe:
    return lambda rng, _: (finishes.masonry(rng, bond), span_m)


def _subway(rng: np.random.Generator, palette: Palette) -> Drawn:
    white = (0.90, 0.90, 0.87), (0.95, 0.95, 0.93)
    tones = white if rng.random() < 0.6 else (palette.front, brightened(palette.front, 1.12))
    bond = Bond(8, 4, tones, (0.66, 0.65, 0.62), joint_px=3.5, grain=0.015)
    return finishes.masonry(rng, bond), 0.66


def _checkers(rng: np.random.Generator, palette: Palette) -> Drawn:
    light, dark = _varied(rng, palette.walls[0]), _varied(rng, palette.front, 0.1)
    bond = Bond(6, 6, (light, brightened(light, 1.12)), (0.5, 0.48, 0.45), 0.0, 3.0, grain=0.02)
    image = finishes.masonry(rng, bond)
    x, y = textures.coordinates()
    odd = (np.floor(6 * x) + np.floor(6 * y)) % 2 > 0
    checks = np.where(odd[..., None], image, np.array(dark) / np.array(light) * image)
    return np.clip(checks, 0, 1).astype(np.float32), 2.0


def _carpet(rng: np.random.Generator, palette: Palette) -> Drawn:
    dark = _varied(rng, palette.cloth, 0.06)
    bond = Bond(4, 4, (dark, brightened(dark, 1.12)), dark, 0.0, 1.5, grain=0.10)
    return finishes.masonry(rng, bond), 2.0


def _worktop(rng: np.random.Generator, palette: Palette) -> Drawn:
    if rng.random() < 0.5:
        return finishes.marble(rng, (0.90, 0.89, 0.87), (0.42, 0.42, 0.44)), 1.3
    return textures.wood(rng, palette.wood, rings=16.0), 0.9


def _wallpaper(rng: np.random.Generator, palette: Palette) -> Drawn:
    ground = _varied(rng, palette.walls[-1])
    motif = np.array(ground) * (0.72 if sum(ground) > 1.2 else 1.4)
    r, g, b = (float(c) for c in np.clip(motif, 0, 1))
    return patterns.wallpaper(rng, ground, (r, g, b)), 0.7


_STONES = ((0.58, 0.55, 0.50), (0.70, 0.66, 0.58), (0.62, 0.60, 0.58))
_PAVERS = ((0.56, 0.53, 0.49), (0.66, 0.62, 0.56), (0.60, 0.54, 0.47), (0.50, 0.49, 0.48))

_RECIPES: dict[str, _Recipe] = {
    "wall": _wall,
    "ceiling": lambda rng, _: (textures.plaster(rng, (0.93, 0.92, 0.90), 0.5), 1.5),
    "wallpaper": _wallpaper,
    "wainscot": lambda rng, p: (finishes.wainscot(rng, _varied(rng, p.front)), 1.2),
    "bricks": _shown(textures.bricks, 0.95),
    "stone": _laid(Bond(8, 5, _STONES, (0.50, 0.46, 0.40), 0.5, 5.0, 2.0, 0.08), 1.9),
    "paving": _laid(Bond(4, 3, _PAVERS, (0.36, 0.33, 0.29), 0.5, 6.0, 1.4, 0.07), 2.0),
    "cobbles": _laid(
        Bond(14, 12, ((0.44, 0.43, 0.42), (0.62, 0.58, 0.54)), (0.30, 0.27, 0.24), 0.5, 7.0, 2.0),
        1.4,
    ),
    "blockwork": _laid(
        Bond(6, 3, ((0.74, 0.73, 0.70), (0.80, 0.79, 0.76)), (0.62, 0.61, 0.58), 0.5, 4.0, 0.8), 1.2
    ),
    "flagstone": _laid(Bond(4, 4, _PAVERS, (0.42, 0.40, 0.37), 0.0, 3.5, 0.3, 0.04), 1.8),
    "stucco": lambda rng, p: (textures.plaster(rng, _varied(rng, p.walls[-1]), 2.2), 1.6),
    "subway": _subway,
    "checkers": _checkers,
    "carpet": _carpet,
    "files": _shown(prints.files),
    "planks": _shown(textures.planks, 1.9),
    "parquet": lambda rng, p: (finishes.herringbone(rng, p.wood), 2.8),
    "terrazzo": lambda rng, _: (finishes.terrazzo(rng, (0.70, 0.68, 0.64)), 1.0),
    "concrete": lambda rng, _: (finishes.concrete(rng, _varied(rng, (0.60, 0.59, 0.57))), 2.2),
    "marble": lambda rng, _: (finishes.marble(rng, (0.88, 0.87, 0.85), (0.45, 0.44, 0.45)), 1.2),
    "worktop": _worktop,
    "chipboard": _shown(finishes.chipboard, 1.1),
    "pegboard": lambda rng, _: (finishes.pegboard(rng, (0.80, 0.74, 0.62)), 0.8),
    "gravel": _shown(finishes.gravel, 0.7),
    "ivy": lambda rng, _: (finishes.ivy(rng, _varied(rng, (0.24, 0.40, 0.14), 0.15)), 1.1),
    "roof": _shown(finishes.roof_tiles, 2.0),
    "pane": lambda rng, _: (_glass(rng), 1.3),
    "bark": lambda rng, _: (textures.wood(rng, WALNUT, rings=14.0), 0.3),
    "leaf": _leaf((0.30, 0.44, 0.18)),
    "blossom": lambda rng, p: (textures.earthenware(rng, _varied(rng, p.accent, 0.4)), 0.2),
    "oak": lambda rng, p: (textures.wood(rng, p.wood), 0.9),
    "walnut": lambda rng, _: (textures.wood(rng, WALNUT), 0.8),
    "sage": _painted(lambda p: p.front),
    "accent": _painted(lambda p: p.accent),
    "white": _painted(lambda _: (0.90, 0.89, 0.86), spread=0.008),
    "black": _painted(lambda _: (0.10, 0.10, 0.11), spread=0.012),
    "steel": _painted(lambda _: (0.66, 0.67, 0.69), 0.9, spread=0.012),
    "metal": _painted(lambda _: (0.40, 0.42, 0.44), spread=0.012),
    "brass": _painted(lambda _: (0.72, 0.56, 0.28), 0.3),
    "red": _painted(lambda _: (0.62, 0.12, 0.10)),
    "sofa": _cloth(lambda p: p.cloth),
    "armchair": _cloth(lambda p: p.accent),
    "leather": _painted(lambda _: (0.36, 0.19, 0.11), 0.5),
    "linen": _cloth(lambda _: (0.87, 0.84, 0.77)),
    "print": _printed(("chevron", "dots", "stripes", "ikat")),
    "ikat": _printed(("ikat",)),
    "drape": _printed(("stripes",)),
    "clay": _clay((0.70, 0.40, 0.27)),
    "glaze": lambda rng, p: (textures.earthenware(rng, _varied(rng, p.front, 0.1)), 0.5),
    "earth": _clay((0.22, 0.16, 0.12)),
    "orange": _clay((0.92, 0.52, 0.12)),
    "apple": _clay((0.66, 0.18, 0.12)),
    "fern": _leaf((0.27, 0.45, 0.18)),
    "rubber": _leaf((0.18, 0.36, 0.16)),
    "books": _shown(artwork.book_spines),
    "rug": _shown(patterns.rug),
    "garden": _shown(artwork.garden),
    "sky": _shown(prints.sky),
    "noticeboard": _shown(prints.noticeboard),
    "whiteboard": _shown(prints.whiteboard),
    "menu": _shown(prints.menu_board),
    "poster": _shown(prints.poster),
    "drawing": _shown(prints.drawing),
    "chart": _shown(artwork.contours),
    "label": lambda rng, p: (prints.label(rng, _varied(rng, p.accent, 0.5)), 1.0),
    "picture": _shown(artwork.painting),
}

_LARGE = FULL_SIZE | frozenset(_RECIPES) - frozenset(
    (*("oak", "walnut", "sage", "accent", "white", "black", "steel", "metal", "brass", "red"),
     *("leather", "linen", "clay", "glaze", "earth", "orange", "apple"),
     *("fern", "rubber", "leaf", "blossom")),
)  # fmt: skip


def _glass(rng: np.random.Generator) -> Float32Array:
    """Dark panes with the sky's clouds reflected in them."""
    image = prints.sky(rng)[64:, :448]
    dark = textures.shaded((0.16, 0.20, 0.24), 1 + 0.1 * textures.noise(rng, (448, 448)))
    return (0.35 * image + 0.65 * dark).astype(np.float32)
