"""A furnished living room of our own, from a seed: 7.0 x 6.0 x 2.8 m, free in the middle.

The window looks north. Everything below a lamp at 2.1 m and above the tables at 0.8 m is open
airspace except at the walls.
"""

import itertools

import numpy as np

from dfvs_core.geometry.arrays import FloatArray
from dfvs_rooms.generator import furniture, props
from dfvs_rooms.generator.room import Opening, Room
from dfvs_rooms.generator.solids import Part, box, panel, placed, sheet, steps
from dfvs_rooms.surfaces.materials import room_materials

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
_WALL_EDGE_M, _FLOOR_EDGE_M, _CEILING_EDGE_M = 0.13, 0.085, 0.20
_SKY_BEHIND_WALL_M = 0.23
_WALLS = frozenset(("plaster", "wallpaper", "bricks"))


def living_room(seed: int) -> Room:
    """Furnish the living room; the seed chooses patterns, paintings, books and plants."""
    materials, parts = np.random.default_rng(seed).spawn(2)
    x0, x1, z0, z1 = WINDOW
    middle = ((x0 + x1) / 2, WIDTH_M / 2 + _SKY_BEHIND_WALL_M, (z0 + z1) / 2)
    sky = Opening(middle, 0.0, (x1 - x0, z1 - z0))
    return Room(room_parts(parts), room_materials(materials), _WALLS, (sky,))


def room_parts(rng: np.random.Generator) -> tuple[Part, ...]:
    """Build the shell and all that is in it, in room axes."""
    parts = _shell() + _window(rng) + _furniture(rng) + _wall_decor(rng)
    return tuple(parts + _plants_and_lamps(rng))


def _shell() -> list[Part]:
    """Floor, ceiling, four walls, mouldings and rugs."""
    e, n, h = _EAST, _NORTH, HEIGHT_M
    parts = [
        panel((-e, -n, 0), (2 * e, 0, 0), (0, 2 * n, 0), "planks", edge_m=_FLOOR_EDGE_M),
        panel((-e, n, h), (2 * e, 0, 0), (0, -2 * n, 0), "ceiling", edge_m=_CEILING_EDGE_M),
        panel((e, n, 0), (0, -2 * n, 0), (0, 0, h), "plaster", edge_m=_WALL_EDGE_M),
        panel((e, -n, 0), (-2 * e, 0, 0), (0, 0, h), "bricks", edge_m=_WALL_EDGE_M),
        panel((-e, -n, 0), (0, 2 * n, 0), (0, 0, h), "wallpaper", edge_m=_WALL_EDGE_M),
        *_north_wall(),
        *_moulding((0.018, 0.09), 0.0, ((-n, 0.96), (2.04, n))),
        *_moulding((0.06, 0.07), h - 0.07, ((-n, n),)),
    ]
    parts += placed(props.rug("rug", 2.9, 1.95, edge_m=_FLOOR_EDGE_M), 0.1, -0.65)
    kilim = props.rug("kilim", 1.9, 1.8, stretched=False, edge_m=_FLOOR_EDGE_M)
    return parts + placed(kilim, -2.42, 0.25)


def _moulding(
    size: tuple[float, float], z: float, west: tuple[tuple[float, float], ...]
) -> list[Part]:
    """White strip of (depth, height) along all walls, on the west wall only on stretches of y."""
    deep, high = size
    ends = "-x +x"
    below = " -z" if z == 0.0 else " +z"
    parts = []
    for side, skip in ((1, " +y"), (-1, " -y")):
        at = (0.0, side * (_NORTH - deep / 2), z)
        parts += box((LENGTH_M, deep, high), at, "white", skip=ends + skip + below, edge_m=0.15)
    at = (_EAST - deep / 2, 0.0, z)
    parts += box((deep, WIDTH_M, high), at, "white", skip="+x -y +y" + below, edge_m=0.15)
    for a, b in west:
        at = (-_EAST + deep / 2, (a + b) / 2, z)
        parts += box((deep, b - a, high), at, "white", skip="-x" + below, edge_m=0.15)
    return parts


def _north_wall() -> list[Part]:
    """Wall with the window's opening cut out, as one mesh without T-junctions, and its reveal."""
    x0, x1, z0, z1 = WINDOW
    xs = _steps_along(-_EAST, x0, x1, _EAST)
    zs = _steps_along(0, z0, z1, HEIGHT_M)
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
        panel((x0, y, z1), (0, deep, 0), (w, 0, 0), "white"),
    ]
    sill = box(
        (w + 0.12, deep + 0.08, 0.04), ((x0 + x1) / 2, y + deep / 2 - 0.04, z0 - 0.04), "white"
    )
    return [cut, *reveal, *sill]


def _steps_along(*ends: float) -> FloatArray:
    """Positions of a wall's vertices along stretches with these ends, each end once."""
    stretches = [steps(low, high, _WALL_EDGE_M) for low, high in itertools.pairwise(ends)]
    return np.unique(np.concatenate(stretches))


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
    level = np.array([-1.6, -0.3, 1.0, 2.2, 3.8, 5.4, 7.0])[:, None]
    bend = (cx + 6.5 * np.sin(1.15 * s), _NORTH + 0.4 + 4.2 * np.cos(1.15 * s))
    view = np.stack(np.broadcast_arrays(*bend, level), -1)
    rise = np.interp(level, [-1.6, 2.2, 7.0], [1.0, 0.345, 0.0])
    uv = np.stack(np.broadcast_arrays(0.5 + 0.5 * s, rise), -1)
    parts.append(sheet(view, uv, "garden"))
    for x in (x0 - 0.28, x1 + 0.28):
        parts += placed(props.curtain(rng, 0.62, 2.42), x, _NORTH - 0.13)
    parts += placed(props.curtain_rail(w + 1.35), cx, _NORTH - 0.13, 2.45)
    return parts + placed(props.radiator(1.7, 0.55), cx, _NORTH)


def _furniture(rng: np.random.Generator) -> list[Part]:
    """Seats and tables on the floor, and what lies on them."""
    parts = placed(furniture.sofa(2.25, "sofa", ("chevron", "dots", "ikat")), 0.1, -2.46, 0, 180)
    parts += placed(furniture.armchair("armchair", "ikat"), -2.35, -1.75, 0, 128)
    parts += placed(furniture.table((1.15, 0.62, 0.42), "oak", "walnut"), 0.1, -0.95, 0)
    parts += placed(furniture.book_pile(rng, 4, "books"), 0.42, -0.95, 0.42)
    parts += placed([props.vase(0.20, "glaze")], -0.15, -0.85, 0.42)
    parts += placed(furniture.bookcase(rng, (1.0, 0.32, 2.15)), 3.33, -1.95, 0, -90)
    parts += placed(furniture.bookcase(rng, (1.0, 0.32, 2.15)), 3.33, -0.93, 0, -90)
    parts += placed(furniture.sideboard((1.75, 0.42, 0.78)), 3.27, 0.85, 0, -90)
    parts += placed(furniture.book_pile(rng, 5, "books"), 3.27, 0.62, 0.78, 70)
    parts += placed([props.vase(0.30, "clay")], 3.27, 0.28, 0.78)
    parts += placed(furniture.table((1.35, 0.85, 0.75), "oak", "oak"), -2.45, 0.25, 0)
    parts += placed(props.fruit_bowl(rng), -2.45, 0.25, 0.75)
    for x in (-2.80, -2.12):
        parts += placed(furniture.chair("linen"), x, 0.85)
        parts += placed(furniture.chair("linen"), x, -0.35, 0, 180)
    parts += placed(furniture.pouf("chevron"), 1.95, -1.15)
    return parts + placed(props.basket(0.24, 0.36), 1.75, -2.55)


def _wall_decor(rng: np.random.Generator) -> list[Part]:
    """Artworks, a shelf, the clock and the door."""
    artworks = (
        ((0.62, 0.46), "contours1", "walnut", (-1.05, -_NORTH, 1.62, 180.0)),
        ((0.48, 0.64), "rectangles1", "black", (-0.05, -_NORTH, 1.70, 180.0)),
        ((0.74, 0.55), "landscape1", "gilt", (0.95, -_NORTH, 1.62, 180.0)),
        ((0.60, 0.60), "swirls1", "black", (2.25, -_NORTH, 1.60, 180.0)),
        ((0.45, 0.60), "botanical1", "oak", (-2.35, -_NORTH, 1.60, 180.0)),
        ((1.05, 0.79), "city", "black", (_EAST, 0.85, 1.62, -90.0)),
        ((0.42, 0.56), "botanical2", "oak", (_EAST, 2.25, 1.60, -90.0)),
        ((0.78, 0.58), "landscape2", "gilt", (-_EAST, 0.10, 1.62, 90.0)),
        ((0.50, 0.50), "swirls2", "oak", (-_EAST, -1.75, 1.60, 90.0)),
        ((0.62, 0.46), "contours2", "walnut", (-_EAST, -0.85, 1.66, 90.0)),
        ((0.40, 0.54), "rectangles2", "black", (-2.75, _NORTH, 1.65, 0.0)),
    )
    parts: list[Part] = []
    for size, artwork, frame, place in artworks:
        parts += placed(props.framed_artwork(*size, artwork, frame), *place)
    parts += placed(props.wall_shelf(rng, 0.95), 2.45, _NORTH, 1.28)
    parts += placed(props.clock(0.17, "brass"), 2.55, _NORTH, 1.95)
    return parts + placed(props.door(0.9, 2.05, "sage", "white"), -_EAST, 1.5, 0, 90)


def _plants_and_lamps(rng: np.random.Generator) -> list[Part]:
    """Pot plants and the three lamps."""
    parts = placed(props.palm(rng, 0.66), 2.62, 2.15)
    parts += placed(props.palm(rng, 0.20, pot_radius=0.07), -0.95, _NORTH + 0.03, WINDOW[2])
    parts += placed(props.palm(rng, 0.24, pot_radius=0.07), 0.62, _NORTH + 0.03, WINDOW[2])
    parts += placed(props.rubber_tree(rng, 1.25), -2.95, 2.55)
    parts += placed(props.palm(rng, 0.42), 2.80, -2.62)
    parts += placed(props.pendant_lamp(0.55, 0.16), 0.1, 0.2, HEIGHT_M)
    parts += placed(props.floor_lamp(1.62), -1.45, -2.55)
    return parts + placed(props.table_lamp(), 3.27, 1.42, 0.78)
