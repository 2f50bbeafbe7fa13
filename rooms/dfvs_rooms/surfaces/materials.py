"""Materials of the living room: an image each, and how many metres it spans."""

from collections.abc import Callable, Collection, Iterable
from dataclasses import dataclass
from functools import partial
from typing import TypeAlias

import numpy as np

from dfvs_core.geometry.arrays import Float32Array, ImageArray
from dfvs_rooms.surfaces import artwork, patterns, textures
from dfvs_rooms.surfaces.textures import Colour

_ON_SMALL_THINGS = frozenset(
    (
        *("ikat", "chevron", "dots", "linen", "wicker", "gilt", "brass", "black"),
        *("orange", "apple", "clay", "glaze", "earth", "fern", "rubber"),
    )
)
"""Materials that never fill an image: half the texels will do."""

_SHINING = frozenset(("globe", "garden", "sky"))

_Draw: TypeAlias = Callable[[np.random.Generator], Float32Array]


@dataclass(frozen=True, slots=True)
class Material:
    """Image of a material.

    Parameters
    ----------
    image : (H, W, 3) uint8
        RGB.
    span_m : float
        Metres that the image spans before it repeats; 1 for images that are stretched.
    shines : bool
        Seen at full brightness whatever the light.
    """

    image: ImageArray
    span_m: float = 1.0
    shines: bool = False


def kind_of(name: str) -> str:
    """A material's name without its number."""
    return name.rstrip("0123456789")


def drawn_materials(
    names: Iterable[str],
    rng: np.random.Generator,
    draw: Callable[[str, np.random.Generator], tuple[Float32Array, float]],
    large: Collection[str],
) -> dict[str, Material]:
    """Draw materials by name.

    Parameters
    ----------
    names : iterable of str
    rng : numpy.random.Generator
    draw : callable
        Gives the image of a kind (:func:`kind_of`) and the metres that it spans.
    large : collection of str
        Kinds that fill an image; half the texels will do for others.
    """
    wanted = sorted(set(names))
    drawn = {}
    for name, stream in zip(wanted, rng.spawn(len(wanted)), strict=True):
        kind = kind_of(name)
        image, span_m = draw(kind, stream)
        if kind not in large:
            image = textures.halved(image)
        drawn[name] = Material(textures.pixels(image), span_m, shines=kind in _SHINING)
    return drawn


def room_materials(rng: np.random.Generator) -> dict[str, Material]:
    """Draw all materials of the room, by name."""
    recipes = {**_surfaces(), **_wood_and_paint(), **_cloths(), **_ceramics_and_plants()}
    recipes |= {name: (draw, 1.0) for name, draw in _images().items()}
    streams = rng.spawn(len(recipes) + 1)
    drawn = {}
    for (name, (draw, span_m)), stream in zip(recipes.items(), streams[1:], strict=True):
        image = draw(stream)
        small = textures.halved(image) if name in _ON_SMALL_THINGS else image
        drawn[name] = Material(textures.pixels(small), span_m)
    drawn["globe"] = Material(np.full((4, 4, 3), 255, np.uint8), shines=True)
    drawn["garden"] = Material(textures.pixels(artwork.garden(streams[0])), shines=True)
    return drawn


def _surfaces() -> dict[str, tuple[_Draw, float]]:
    """Walls, floor and ceiling."""
    paper = partial(patterns.wallpaper, ground=(0.66, 0.73, 0.68), motif=(0.42, 0.55, 0.50))
    return {
        "plaster": (partial(textures.plaster, colour=(0.90, 0.87, 0.80)), 1.2),
        "ceiling": (partial(textures.plaster, colour=(0.93, 0.92, 0.90), contrast=0.8), 1.5),
        "wallpaper": (paper, 0.72),
        "bricks": (textures.bricks, 0.95),
        "planks": (textures.planks, 1.9),
    }


def _wood_and_paint() -> dict[str, tuple[_Draw, float]]:
    """Furniture wood, painted wood and metal."""
    wood, paint = textures.wood, textures.paint
    gilt = ((0.80, 0.64, 0.34), (0.68, 0.50, 0.24), (0.50, 0.36, 0.16))
    return {
        "oak": (partial(wood, colours=textures.OAK), 0.9),
        "walnut": (partial(wood, colours=textures.WALNUT), 0.8),
        "gilt": (partial(wood, colours=gilt), 0.3),
        "white": (partial(paint, colour=(0.88, 0.87, 0.84)), 0.6),
        "sage": (partial(paint, colour=(0.52, 0.60, 0.52)), 0.6),
        "black": (partial(paint, colour=(0.10, 0.10, 0.11)), 0.6),
        "brass": (partial(paint, colour=(0.72, 0.56, 0.28)), 0.3),
    }


def _cloths() -> dict[str, tuple[_Draw, float]]:
    """Upholstery, cushions and curtains."""

    def printed(kind: str, first: Colour, second: Colour) -> _Draw:
        return partial(patterns.pattern_cloth, kind=kind, first=first, second=second)

    return {
        "sofa": (partial(textures.cloth, colour=(0.22, 0.36, 0.44)), 0.55),
        "armchair": (partial(textures.cloth, colour=(0.72, 0.47, 0.22)), 0.55),
        "linen": (partial(textures.cloth, colour=(0.84, 0.80, 0.72)), 0.5),
        "chevron": (printed("chevron", (0.86, 0.80, 0.68), (0.70, 0.32, 0.20)), 0.6),
        "dots": (printed("dots", (0.88, 0.72, 0.34), (0.96, 0.94, 0.88)), 0.7),
        "ikat": (printed("ikat", (0.14, 0.24, 0.36), (0.88, 0.82, 0.70)), 0.7),
        "kilim": (printed("ikat", (0.62, 0.30, 0.20), (0.88, 0.80, 0.64)), 0.95),
        "drape": (printed("stripes", (0.93, 0.89, 0.80), (0.80, 0.80, 0.71)), 0.9),
    }


def _ceramics_and_plants() -> dict[str, tuple[_Draw, float]]:
    """Pots, fruit, basketwork and leaves."""
    clay, leaf = textures.earthenware, textures.foliage
    return {
        "clay": (partial(clay, colour=(0.70, 0.40, 0.27)), 0.5),
        "glaze": (partial(clay, colour=(0.30, 0.48, 0.50)), 0.5),
        "earth": (partial(clay, colour=(0.22, 0.16, 0.12)), 0.4),
        "orange": (partial(clay, colour=(0.92, 0.52, 0.12)), 0.5),
        "apple": (partial(clay, colour=(0.70, 0.16, 0.12)), 0.5),
        "wicker": (textures.wicker, 0.5),
        "fern": (partial(leaf, colour=(0.30, 0.50, 0.20)), 1.0),
        "rubber": (partial(leaf, colour=(0.18, 0.38, 0.17)), 1.0),
    }


def _images() -> dict[str, _Draw]:
    """Things that are shown once, and every painting only on one wall."""
    return {
        "rug": patterns.rug,
        "books": artwork.book_spines,
        "clock": artwork.clock_face,
        "city": artwork.city,
        **{f"landscape{k}": artwork.landscape for k in (1, 2)},
        **{f"rectangles{k}": artwork.rectangles for k in (1, 2)},
        **{f"contours{k}": artwork.contours for k in (1, 2)},
        **{f"swirls{k}": artwork.swirls for k in (1, 2)},
        **{f"botanical{k}": artwork.botanical for k in (1, 2)},
    }
