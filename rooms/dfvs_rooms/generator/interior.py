"""Interiors drawn from a seed: sizes, walls, light and furniture all differ.

Four kinds: a ``lounge`` to live in, a ``study`` with desks and shelves, a ``corridor``, and a
``hall`` with columns and racks.
"""

from dataclasses import dataclass

import numpy as np

from dfvs_core.errors import ConfigError
from dfvs_rooms.generator import interior_furniture as pieces
from dfvs_rooms.generator import props
from dfvs_rooms.generator.interior_materials import interior_materials
from dfvs_rooms.generator.layout import Layout, Piece
from dfvs_rooms.generator.room import Room
from dfvs_rooms.generator.solids import Part, box, panel, placed


@dataclass(frozen=True, slots=True)
class Kind:
    """What a kind of interior is like. Pairs are (least, most), sizes in m."""

    length_m: tuple[float, float]
    width_m: tuple[float, float]
    height_m: tuple[float, float]
    along_walls: tuple[pieces.Draw, ...]
    in_the_middle: tuple[pieces.Draw, ...]
    """What may stand there."""
    crowd: tuple[float, float]
    """Things along the walls per metre of wall."""
    islands: tuple[int, int]
    """Things in the middle."""
    window_share: float
    """How often it has windows."""


KINDS: dict[str, Kind] = {
    "lounge": Kind(
        (4.0, 7.5),
        (3.4, 6.0),
        (2.4, 3.1),
        (
            *(pieces.sofa, pieces.armchair, pieces.bookcase, pieces.sideboard, pieces.plant),
            *(pieces.standing_lamp, pieces.basket, pieces.bed, pieces.wardrobe),
        ),
        (pieces.low_table, pieces.dining_table, pieces.seat, pieces.ball, pieces.armchair),
        (0.25, 0.55),
        (1, 4),
        0.85,
    ),
    "study": Kind(
        (3.2, 6.0),
        (2.8, 4.5),
        (2.4, 2.9),
        (
            *(pieces.desk, pieces.desk, pieces.bookcase, pieces.bookcase, pieces.wardrobe),
            *(pieces.cartons, pieces.plant, pieces.standing_lamp, pieces.seat),
        ),
        (pieces.seat, pieces.cartons, pieces.dining_table),
        (0.3, 0.6),
        (0, 2),
        0.7,
    ),
    "corridor": Kind(
        (6.0, 10.0),
        (1.9, 2.8),
        (2.3, 3.0),
        (pieces.door, pieces.door, pieces.radiator, pieces.plant, pieces.seat, pieces.basket),
        (pieces.ball,),
        (0.2, 0.4),
        (0, 1),
        0.3,
    ),
    "hall": Kind(
        (7.0, 11.0),
        (5.5, 8.0),
        (2.9, 4.2),
        (
            *(pieces.rack, pieces.rack, pieces.cartons, pieces.wardrobe, pieces.door),
            *(pieces.radiator, pieces.desk, pieces.plant),
        ),
        (pieces.dining_table, pieces.cartons, pieces.rack, pieces.seat, pieces.ball),
        (0.25, 0.5),
        (2, 7),
        0.6,
    ),
}
"""Kinds of interiors by name."""

_WINDOW_DEPTH_M = 0.05
_M2_PER_LAMP = 9.0


def drawn_interior(seed: int, kind: str | None = None) -> Room:
    """Draw an interior; the seed alone decides, also on its kind where none is given.

    Raises
    ------
    ConfigError
        If there is no such kind.
    """
    if kind is not None and kind not in KINDS:
        raise ConfigError(f"no kind of room {kind!r}", f"one of {', '.join(KINDS)}")
    shape, looks = np.random.default_rng([seed, 1]).spawn(2)
    drawn = str(shape.choice(list(KINDS)))
    return painted(draw_layout(KINDS[kind or drawn], shape), looks)


def painted(layout: Layout, looks: np.random.Generator) -> Room:
    """Draw materials for the parts of an interior."""
    names = {part.material for part in layout.parts}
    walls = frozenset(name for name in names if name.startswith("wall"))
    materials = interior_materials(names, looks)
    return Room(tuple(layout.parts), materials, walls, tuple(layout.openings))


def draw_layout(kind: Kind, rng: np.random.Generator) -> Layout:
    """Draw the shell of an interior of a kind, and what stands and hangs in it."""
    size = tuple(float(rng.uniform(*r)) for r in (kind.length_m, kind.width_m, kind.height_m))
    layout = Layout((size[0], size[1], size[2]), rng)
    layout.parts += _shell(layout, rng)
    if rng.random() < kind.window_share:
        _add_windows(layout, rng)
    if not layout.against_wall(pieces.door(rng)):
        layout.against_wall(pieces.basket(rng))
    _maybe_rug(layout, rng)
    if min(size[:2]) > 4.0 and size[0] > 6.0 and rng.random() < 0.6:
        for _ in range(int(rng.integers(1, 5))):
            layout.in_the_middle(pieces.pillar(rng, layout.height_m), turned=False)
    perimeter = 2 * (size[0] + size[1])
    for _ in range(round(rng.uniform(*kind.crowd) * perimeter)):
        layout.against_wall(_one_of(kind.along_walls, rng))
    for _ in range(int(rng.integers(kind.islands[0], kind.islands[1] + 1))):
        layout.in_the_middle(_one_of(kind.in_the_middle, rng))
    for _ in range(round(rng.uniform(0.15, 0.6) * perimeter)):
        draw = pieces.artwork if rng.random() < 0.65 else pieces.wall_thing
        layout.on_wall(draw(rng), (1.15, 1.9))
    _hang_lamps(layout, rng)
    return layout


def _one_of(choices: tuple[pieces.Draw, ...], rng: np.random.Generator) -> Piece:
    return choices[int(rng.integers(len(choices)))](rng)


def _shell(layout: Layout, rng: np.random.Generator) -> list[Part]:
    """Floor, ceiling and four walls, each wall of one of up to three materials, and skirting."""
    (e, n), h = layout.half, layout.height_m
    edge = 0.11 if e * n < 8 else 0.15
    names = [f"wall{k}" for k in rng.integers(0, int(rng.integers(1, 4)), 4)]
    corners = (
        ((-e, n, 0), (2 * e, 0, 0)),
        ((e, n, 0), (0, -2 * n, 0)),
        ((e, -n, 0), (-2 * e, 0, 0)),
        ((-e, -n, 0), (0, 2 * n, 0)),
    )
    parts = [
        panel((-e, -n, 0), (2 * e, 0, 0), (0, 2 * n, 0), "floor", edge_m=edge),
        panel((-e, n, h), (2 * e, 0, 0), (0, -2 * n, 0), "ceiling", edge_m=edge),
    ]
    for name, (start, across) in zip(names, corners, strict=True):
        parts.append(panel(start, across, (0, 0, h), name, edge_m=edge))
    if rng.random() < 0.7:
        high = float(rng.uniform(0.05, 0.14))
        material = str(rng.choice(["white", "oak", "black"]))
        for wall in layout.walls:
            strip = box((wall.length_m, 0.016, high), (0, 0, 0), material, skip="+y -z -x +x")
            parts += placed(placed(strip, 0, wall.distance_m - 0.008), 0, 0, 0, wall.turn_deg)
    return parts


def _add_windows(layout: Layout, rng: np.random.Generator) -> None:
    """Hang one to three windows, with curtains or without, that let in light."""
    for _ in range(int(rng.integers(1, 4))):
        width, height = float(rng.uniform(0.7, 1.9)), float(rng.uniform(0.8, 1.4))
        parts = window(width, height, int(rng.integers(1, 4)))
        if rng.random() < 0.4:
            for side in (-1, 1):
                cloth = props.curtain(rng, 0.3, height + 0.3)
                parts += placed(cloth, side * (width / 2 + 0.12), -0.1, -height / 2 - 0.25)
        piece = Piece(tuple(parts), width + 0.55, 0.2, height / 2 + 0.06)
        found = layout.on_wall(piece, (1.35, 1.7))
        if found is not None:
            wall, s, z = found
            layout.let_in_light(wall, (s, z), (width, height))


def window(width: float, height: float, panes: int) -> list[Part]:
    """Frame around the view outside, its middle at the origin, on a wall towards +y."""
    view = panel(
        (-width / 2, -0.012, -height / 2),
        (width, 0, 0),
        (0, 0, height),
        "garden",
        stretched=True,
        edge_m=0.5,
    )
    parts = [view]
    for z in (-height / 2, height / 2 - 0.05):
        parts += box((width, _WINDOW_DEPTH_M, 0.05), (0, -0.025, z), "white", skip="+y")
    for x in np.linspace(-width / 2 + 0.025, width / 2 - 0.025, panes + 1):
        at = (float(x), -0.025, -height / 2)
        parts += box((0.05, _WINDOW_DEPTH_M, height), at, "white", skip="+y")
    sill = (0, -0.08, -height / 2 - 0.03)
    return parts + box((width + 0.1, 0.16, 0.03), sill, "white", skip="+y")


def _maybe_rug(layout: Layout, rng: np.random.Generator) -> None:
    """Lay a rug near the middle, in half of the rooms; it takes no place from furniture."""
    limit = 2 * layout.half - 1.0
    if rng.random() < 0.5 or (limit < 1.0).any():
        return
    width, depth = (float(min(a, b)) for a, b in zip(limit, rng.uniform(1.2, 3.0, 2), strict=True))
    material, stretched = ("rug", True) if rng.random() < 0.5 else ("kilim", False)
    parts = props.rug(material, width, depth, stretched=stretched)
    layout.parts += placed(parts, *(float(v) for v in rng.uniform(-0.4, 0.4, 2)))


def _hang_lamps(layout: Layout, rng: np.random.Generator) -> None:
    """Hang globes on a regular grid, about one for every nine square metres."""
    columns, rows = (max(1, round(2 * float(half) / _M2_PER_LAMP**0.5)) for half in layout.half)
    drop, radius = float(rng.uniform(0.25, 0.7)), float(rng.uniform(0.1, 0.2))
    layout.hang_lamps(props.pendant_lamp(drop, radius), columns, rows)
