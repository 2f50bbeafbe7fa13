"""Materials: an image each, and how many metres it spans; and those of the living room."""

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

Drawn: TypeAlias = tuple[Float32Array, float]
"""An image and the metres that it spans."""
_Draw: TypeAlias = Callable[[np.random.Generator], Float32Array]


@dataclass(frozen=True, slots=True)
class Material:
    """Image of a material."""

    image: ImageArray
    """(H, W, 3) uint8: RGB."""
    span_m: float = 1.0
    """Metres that the image spans before it repeats; 1 for images that are stretched."""
    shines: bool = False
    """Seen at full brightness whatever the light."""


def kind_of(name: str) -> str:
    """A material's name without its number."""
    return name.rstrip("0123456789")


def drawn_materials(
    names: Iterable[str],
    rng: np.random.Generator,
    draw: Callable[[str, np.random.Generator], Drawn],
    large: Collection[str],
) -> dict[str, Material]:
    """Draw materials by name, each of its kind (:func:`kind_of`).

    ``large`` kinds fill an image; half the texels will do for others.
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
    """Draw all materials of the living room, by name."""
    streams = rng.spawn(len(_RECIPES) + 1)
    drawn = {}
    for (name, (draw, span_m)), stream in zip(_RECIPES.items(), streams[1:], strict=True):
        image = draw(stream)
        small = textures.halved(image) if name in _ON_SMALL_THINGS else image
        drawn[name] = Material(textures.pixels(small), span_m)
    drawn["globe"] = Material(np.full((4, 4, 3), 255, np.uint8), shines=True)
    drawn["garden"] = Material(textures.pixels(artwork.garden(streams[0])), shines=True)
    return drawn


def _printed(kind: str, first: Colour, second: Colour) -> _Draw:
    return partial(patterns.pattern_cloth, kind=kind, first=first, second=second)


_GILT = ((0.80, 0.64, 0.34), (0.68, 0.50, 0.24), (0.50, 0.36, 0.16))
_DAMASK = partial(patterns.wallpaper, ground=(0.66, 0.73, 0.68), motif=(0.42, 0.55, 0.50))

_RECIPES: dict[str, tuple[_Draw, float]] = {
    "plaster": (partial(textures.plaster, colour=(0.90, 0.87, 0.80)), 1.2),
    "ceiling": (partial(textures.plaster, colour=(0.93, 0.92, 0.90), contrast=0.8), 1.5),
    "wallpaper": (_DAMASK, 0.72),
    "bricks": (textures.bricks, 0.95),
    "planks": (textures.planks, 1.9),
    "oak": (partial(textures.wood, colours=textures.OAK), 0.9),
    "walnut": (partial(textures.wood, colours=textures.WALNUT), 0.8),
    "gilt": (partial(textures.wood, colours=_GILT), 0.3),
    "white": (partial(textures.paint, colour=(0.88, 0.87, 0.84)), 0.6),
    "sage": (partial(textures.paint, colour=(0.52, 0.60, 0.52)), 0.6),
    "black": (partial(textures.paint, colour=(0.10, 0.10, 0.11)), 0.6),
    "brass": (partial(textures.paint, colour=(0.72, 0.56, 0.28)), 0.3),
    "sofa": (partial(textures.cloth, colour=(0.22, 0.36, 0.44)), 0.55),
    "armchair": (partial(textures.cloth, colour=(0.72, 0.47, 0.22)), 0.55),
    "linen": (partial(textures.cloth, colour=(0.84, 0.80, 0.72)), 0.5),
    "chevron": (_printed("chevron", (0.86, 0.80, 0.68), (0.70, 0.32, 0.20)), 0.6),
    "dots": (_printed("dots", (0.88, 0.72, 0.34), (0.96, 0.94, 0.88)), 0.7),
    "ikat": (_printed("ikat", (0.14, 0.24, 0.36), (0.88, 0.82, 0.70)), 0.7),
    "kilim": (_printed("ikat", (0.62, 0.30, 0.20), (0.88, 0.80, 0.64)), 0.95),
    "drape": (_printed("stripes", (0.93, 0.89, 0.80), (0.80, 0.80, 0.71)), 0.9),
    "clay": (partial(textures.earthenware, colour=(0.70, 0.40, 0.27)), 0.5),
    "glaze": (partial(textures.earthenware, colour=(0.30, 0.48, 0.50)), 0.5),
    "earth": (partial(textures.earthenware, colour=(0.22, 0.16, 0.12)), 0.4),
    "orange": (partial(textures.earthenware, colour=(0.92, 0.52, 0.12)), 0.5),
    "apple": (partial(textures.earthenware, colour=(0.70, 0.16, 0.12)), 0.5),
    "wicker": (textures.wicker, 0.5),
    "fern": (partial(textures.foliage, colour=(0.30, 0.50, 0.20)), 1.0),
    "rubber": (partial(textures.foliage, colour=(0.18, 0.38, 0.17)), 1.0),
    "rug": (patterns.rug, 1.0),
    "books": (artwork.book_spines, 1.0),
    "clock": (artwork.clock_face, 1.0),
    "city": (artwork.city, 1.0),
    **{f"landscape{k}": (artwork.landscape, 1.0) for k in (1, 2)},
    **{f"rectangles{k}": (artwork.rectangles, 1.0) for k in (1, 2)},
    **{f"contours{k}": (artwork.contours, 1.0) for k in (1, 2)},
    **{f"swirls{k}": (artwork.swirls, 1.0) for k in (1, 2)},
    **{f"botanical{k}": (artwork.botanical, 1.0) for k in (1, 2)},
}
"""How the living room's materials are drawn, and the metres that each spans; no painting twice."""
