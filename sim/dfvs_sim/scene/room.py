"""A furnished living room of our own, from a seed: 7.0 x 6.0 x 2.8 m, free in the middle.

The window looks north. Everything below a lamp at 2.1 m and above the tables at 0.8 m is open
airspace except at the walls.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import partial

import numpy as np

from dfvs_core.arrays import ImageArray
from dfvs_sim.scene import pictures, textures
from dfvs_sim.scene.decor import (
    basket,
    clock,
    curtain,
    curtain_rail,
    door,
    floor_lamp,
    framed_picture,
    fruit_bowl,
    palm,
    pendant_lamp,
    radiator,
    rubber_tree,
    table_lamp,
    vase,
)
from dfvs_sim.scene.furniture import armchair, book_pile, bookcase, chair, sideboard, sofa, table
from dfvs_sim.scene.solids import Part, box, panel, placed, sheet, steps

LENGTH_M, WIDTH_M, HEIGHT_M = 7.0, 6.0, 2.8
WINDOW = (-1.5, 1.1, 0.85, 2.35)
"""Window opening in the north wall: x from, to, z from, to, m."""

VIEWS: dict[str, tuple[tuple[float, float, float], tuple[float, float, float]]] = {
    "window": ((-2.6, 1.55, 2.35), (1.4, 1.05, -2.0)),
    "dining": ((2.7, 1.6, 2.2), (-2.2, 0.95, -1.3)),
    "sofa": ((2.4, 1.6, -2.3), (-1.4, 0.85, 2.2)),
    "books": ((-2.4, 1.6, -2.3), (2.5, 0.95, 1.6)),
}
"""Good views: eye and point looked at, in the scene file's axes (x right, y up), m."""

_EAST, _NORTH = LENGTH_M / 2, WIDTH_M / 2
_WALL_EDGE_M, _FLOOR_EDGE_M, _CEILING_EDGE_M = 0.13, 0.085, 0.22


@dataclass(frozen=True, slots=True)
class Material:
    """Picture of a material and how many metres it spans; ``span_m`` of 1 for pictures."""

    image: ImageArray
    span_m: float = 1.0
    shines: bool = False


@dataclass(frozen=True, slots=True)
class Room:
    """Parts of a room in room axes, and their materials by name."""

    parts: tuple[Part, ...]
    materials: dict[str, Material]


def furnished_room(seed: int) -> Room:
    """Furnish the living room; the seed chooses patterns, paintings, books and plants."""
    rng = np.random.default_rng(seed)
    materials = room_materials(rng)
    parts = _shell() + _window(rng) + _furniture(rng) + _wall_decor() + _plants_and_lamps(rng)
    return Room(tuple(parts), materials)


def room_materials(rng: np.random.Generator) -> dict[str, Material]:
    """Draw all pictures of the room."""
    t, p = textures, pictures
    make = {
        "plaster": (partial(t.plaster, colour=(0.90, 0.86, 0.78)), 1.3),
        "ceiling": (partial(t.plaster, colour=(0.93, 0.92, 0.89), contrast=0.8), 1.6),
        "wallpaper": (
            partial(p.wallpaper, ground=(0.66, 0.73, 0.68), motif=(0.42, 0.55, 0.50)),
            0.72,
        ),
        "bricks": (t.bricks, 0.95),
        "planks": (t.planks, 1.9),
        "oak": (partial(t.wood, colours=t.OAK), 0.9),
        "walnut": (partial(t.wood, colours=t.WALNUT), 0.8),
        "sofa": (partial(t.cloth, colour=(0.22, 0.36, 0.44)), 0.55),
        "armchair": (partial(t.cloth, colour=(0.72, 0.47, 0.22)), 0.55),
        "linen": (partial(t.cloth, colour=(0.82, 0.77, 0.68)), 0.5),
        "chevron": (
            partial(
                p.pattern_cloth, kind="chevron", first=(0.86, 0.80, 0.68), second=(0.70, 0.32, 0.20)
            ),
            0.6,
        ),
        "dots": (
            partial(
                p.pattern_cloth, kind="dots", first=(0.88, 0.72, 0.34), second=(0.96, 0.94, 0.88)
            ),
            0.7,
        ),
        "ikat": (
            partial(
                p.pattern_cloth, kind="ikat", first=(0.14, 0.24, 0.36), second=(0.88, 0.82, 0.70)
            ),
            0.7,
        ),
        "drape": (
            partial(
                p.pattern_cloth, kind="stripes", first=(0.82, 0.76, 0.64), second=(0.55, 0.60, 0.52)
            ),
            0.8,
        ),
        "white": (partial(t.paint, colour=(0.88, 0.87, 0.83)), 0.6),
        "sage": (partial(t.paint, colour=(0.52, 0.60, 0.52)), 0.6),
        "black": (partial(t.paint, colour=(0.10, 0.10, 0.11)), 0.6),
        "brass": (partial(t.paint, colour=(0.72, 0.56, 0.28)), 0.3),
        "gilt": (
            partial(t.wood, colours=((0.80, 0.64, 0.34), (0.68, 0.50, 0.24), (0.50, 0.36, 0.16))),
            0.3,
        ),
        "clay": (partial(t.earthenware, colour=(0.70, 0.40, 0.27)), 0.5),
        "glaze": (partial(t.earthenware, colour=(0.30, 0.48, 0.50)), 0.5),
        "earth": (partial(t.earthenware, colour=(0.22, 0.16, 0.12)), 0.4),
        "orange": (partial(t.earthenware, colour=(0.92, 0.52, 0.12)), 0.5),
        "apple": (partial(t.earthenware, colour=(0.70, 0.16, 0.12)), 0.5),
        "wicker": (t.wicker, 0.5),
        "fern": (partial(t.foliage, colour=(0.24, 0.42, 0.16)), 1.0),
        "rubber": (partial(t.foliage, colour=(0.13, 0.30, 0.13)), 1.0),
        "rug": (p.rug, 1.0),
        "books": (p.book_spines, 1.0),
        "landscape": (p.landscape, 1.0),
        "rectangles": (p.rectangles, 1.0),
        "contours": (p.contours, 1.0),
        "swirls": (p.swirls, 1.0),
        "city": (p.city, 1.0),
        "botanical": (p.botanical, 1.0),
        "clock": (p.clock_face, 1.0),
    }
    drawn = {
        name: Material(textures.pixels(draw(stream)), span_m)
        for (name, (draw, span_m)), stream in zip(make.items(), rng.spawn(len(make)), strict=True)
    }
    white = np.full((4, 4, 3), 255, np.uint8)
    drawn["globe"] = Material(white, 1.0, shines=True)
    drawn["garden"] = Material(textures.pixels(p.garden(rng)), 1.0, shines=True)
    return drawn


def _shell() -> list[Part]:
    """Floor, ceiling, four walls, skirting and rug."""
    e, n, h = _EAST, _NORTH, HEIGHT_M
    parts = [
        panel((-e, -n, 0), (2 * e, 0, 0), (0, 2 * n, 0), "planks", edge_m=_FLOOR_EDGE_M),
        panel((-e, n, h), (2 * e, 0, 0), (0, -2 * n, 0), "ceiling", edge_m=_CEILING_EDGE_M),
        panel((e, n, 0), (0, -2 * n, 0), (0, 0, h), "plaster", edge_m=_WALL_EDGE_M),
        panel((e, -n, 0), (-2 * e, 0, 0), (0, 0, h), "bricks", edge_m=_WALL_EDGE_M),
        panel((-e, -n, 0), (0, 2 * n, 0), (0, 0, h), "wallpaper", edge_m=_WALL_EDGE_M),
        *_north_wall(),
    ]
    for y in (-1, 1):
        at = (0, y * (n - 0.009), 0)
        parts += box(
            (2 * e, 0.018, 0.09), at, "white", skip="-x +x -z" + (" +y" if y > 0 else " -y")
        )
    doorway = (1.05, 1.95)
    for a, b in ((-n, doorway[0] - 0.09), (doorway[1] + 0.09, n)):
        at = (-e + 0.009, (a + b) / 2, 0)
        parts += box((0.018, b - a, 0.09), at, "white", skip="-x -z")
    parts += box((0.018, 2 * n, 0.09), (e - 0.009, 0, 0), "white", skip="+x -z")
    return [*parts, *placed(_rug(), 0.1, -0.65)]


def _north_wall() -> list[Part]:
    """Wall with the window's opening cut out, as one mesh without T-junctions, and its reveal."""
    x0, x1, z0, z1 = WINDOW
    xs = np.concatenate(
        [
            steps(-_EAST, x0, _WALL_EDGE_M),
            steps(x0, x1, _WALL_EDGE_M)[1:],
            steps(x1, _EAST, _WALL_EDGE_M)[1:],
        ]
    )
    zs = np.concatenate(
        [
            steps(0, z0, _WALL_EDGE_M),
            steps(z0, z1, _WALL_EDGE_M)[1:],
            steps(z1, HEIGHT_M, _WALL_EDGE_M)[1:],
        ]
    )
    gx, gz = np.meshgrid(xs, zs)
    points = np.stack([gx, np.full_like(gx, _NORTH), gz], -1)
    wall = sheet(points, np.stack([gx, -gz], -1), "plaster", is_sheet=False)
    middle = wall.vertices[wall.triangles].mean(axis=1)
    hole = (middle[:, 0] > x0) & (middle[:, 0] < x1) & (middle[:, 2] > z0) & (middle[:, 2] < z1)
    used, index = np.unique(wall.triangles[~hole], return_inverse=True)
    cut = Part(
        wall.vertices[used],
        wall.normals[used],
        wall.uv[used],
        index.reshape(-1, 3).astype(np.int32),
        "plaster",
    )
    w, h, y, deep = x1 - x0, z1 - z0, _NORTH, 0.22
    reveal = [
        panel((x0, y, z0), (0, deep, 0), (0, 0, h), "white"),
        panel((x1, y + deep, z0), (0, -deep, 0), (0, 0, h), "white"),
        panel((x0, y, z1), (0, deep, 0), (w, 0, 0), "white").moved(0, 0, 0),
    ]
    sill = box(
        (w + 0.12, deep + 0.14, 0.04), ((x0 + x1) / 2, y + deep / 2 - 0.07, z0 - 0.04), "white"
    )
    return [cut, *reveal, *sill]


def _window(rng: np.random.Generator) -> list[Part]:
    """Window frame, the view outside, curtains and the radiator below."""
    x0, x1, z0, z1 = WINDOW
    y = _NORTH + 0.15
    w, h, cx = x1 - x0, z1 - z0, (x0 + x1) / 2
    parts: list[Part] = []
    for z in (z0, z1 - 0.06):
        parts += box((w, 0.06, 0.06), (cx, y, z), "white")
    parts += box((w, 0.04, 0.04), (cx, y, z0 + 0.66 * h), "white")
    for x in (x0 + 0.03, x0 + w / 3, x0 + 2 * w / 3, x1 - 0.03):
        parts += box((0.055, 0.05, h), (x, y, z0), "white")
    s = np.linspace(-1.0, 1.0, 13)[None, :]
    z = np.linspace(-1.6, 4.2, 7)[:, None]
    view = np.stack(
        np.broadcast_arrays(cx + 6.5 * np.sin(1.15 * s), _NORTH + 0.4 + 4.2 * np.cos(1.15 * s), z),
        -1,
    )
    uv = np.stack(np.broadcast_arrays(0.5 + 0.5 * s, (4.2 - z) / 5.8), -1)
    parts.append(sheet(view, uv, "garden"))
    for x in (x0 - 0.28, x1 + 0.28):
        parts += placed(curtain(rng, 0.62, 2.42, "drape"), x, _NORTH - 0.13)
    parts += placed(curtain_rail(w + 1.35, "brass"), cx, _NORTH - 0.13, 2.45)
    return parts + placed(radiator(1.7, 0.55, "white"), cx, _NORTH)


def _rug() -> list[Part]:
    """Rug of 2.9 x 1.95 m, a little above the floor."""
    top = panel(
        (-1.45, -0.975, 0.012), (2.9, 0, 0), (0, 1.95, 0), "rug", edge_m=0.085, picture=True
    )
    return [top, *box((2.9, 1.95, 0.0118), (0, 0, 0), "linen", skip="+z -z", edge_m=0.2)]


def _furniture(rng: np.random.Generator) -> list[Part]:
    """Seats and tables on the floor, and what lies on them."""
    parts = placed(sofa(2.25, "sofa", ("chevron", "dots", "ikat")), 0.1, -2.46, 0, 180)
    parts += placed(armchair("armchair", "ikat"), -2.35, -1.75, 0, 128)
    parts += placed(table((1.15, 0.62, 0.42), "oak", "walnut"), 0.1, -0.95, 0)
    parts += placed(book_pile(rng, 4, "books"), 0.42, -0.95, 0.42)
    parts += placed([vase(0.20, "glaze")], -0.15, -0.85, 0.42)
    parts += placed(bookcase(rng, (1.0, 0.32, 2.15), "walnut", "books"), 3.33, -1.95, 0, -90)
    parts += placed(bookcase(rng, (1.0, 0.32, 2.15), "walnut", "books"), 3.33, -0.93, 0, -90)
    parts += placed(sideboard((1.75, 0.42, 0.78), "oak", "sage"), 3.27, 0.85, 0, -90)
    parts += placed(book_pile(rng, 5, "books"), 3.27, 0.62, 0.78, 70)
    parts += placed([vase(0.30, "clay")], 3.27, 0.28, 0.78)
    parts += placed(table((1.35, 0.85, 0.75), "oak", "oak"), -2.45, 2.1 - 1.85, 0)
    parts += placed(fruit_bowl(rng), -2.45, 0.25, 0.75)
    for x, turn in ((-2.80, 0.0), (-2.12, 0.0)):
        parts += placed(chair("walnut", "linen"), x, 0.25 + 0.60, 0, turn)
        parts += placed(chair("walnut", "linen"), x, 0.25 - 0.60, 0, 180 + turn)
    return parts + placed(basket(0.24, 0.36), 1.75, -2.55)


def _wall_decor() -> list[Part]:
    """Pictures, the clock and the door."""
    south = [
        (-1.05, 1.62, 0.62, 0.46, "contours", "walnut"),
        (-0.05, 1.70, 0.48, 0.64, "rectangles", "black"),
        (0.95, 1.62, 0.74, 0.55, "landscape", "gilt"),
        (2.25, 1.60, 0.60, 0.60, "swirls", "black"),
        (-2.35, 1.60, 0.45, 0.60, "botanical", "oak"),
    ]
    parts: list[Part] = []
    for x, z, w, h, picture, frame in south:
        parts += placed(framed_picture(w, h, picture, frame), x, -_NORTH, z, 180)
    parts += placed(framed_picture(1.05, 0.79, "city", "black"), _EAST, 0.85, 1.62, -90)
    parts += placed(framed_picture(0.42, 0.56, "botanical", "oak"), _EAST, 2.25, 1.60, -90)
    parts += placed(framed_picture(0.78, 0.58, "landscape", "gilt"), -_EAST, 0.10, 1.62, 90)
    parts += placed(framed_picture(0.50, 0.50, "swirls", "oak"), -_EAST, -1.75, 1.60, 90)
    parts += placed(framed_picture(0.62, 0.46, "contours", "walnut"), -_EAST, -0.85, 1.66, 90)
    parts += placed(framed_picture(0.40, 0.54, "rectangles", "black"), -2.75, _NORTH, 1.65, 0)
    parts += placed(clock(0.17, "clock", "brass"), 2.55, _NORTH, 1.95)
    return parts + placed(door(0.9, 2.05, "sage", "white"), -_EAST, 1.5, 0, 90)


def _plants_and_lamps(rng: np.random.Generator) -> list[Part]:
    """Pot plants and the three lamps."""
    parts = placed(palm(rng, 0.75, "fern"), 2.75, 2.35)
    parts += placed(rubber_tree(rng, 1.25, "rubber"), -2.95, 2.55)
    parts += placed(palm(rng, 0.42, "fern"), 2.85, -2.60)
    parts += placed(pendant_lamp(0.55, 0.16), 0.1, 0.2, HEIGHT_M)
    parts += placed(floor_lamp(1.62, "linen"), -1.45, -2.55)
    return parts + placed(table_lamp("linen"), 3.27, 1.42, 0.78)
