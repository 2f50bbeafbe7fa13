"""What stands and hangs in the drawn interiors, of drawn sizes."""

from collections.abc import Callable
from typing import TypeAlias

import numpy as np

from dfvs_rooms.generator import furniture, props
from dfvs_rooms.generator.layout import Piece
from dfvs_rooms.generator.solids import Part, box, cushion, lathe, panel, placed, sphere, tube

Draw: TypeAlias = Callable[[np.random.Generator], Piece]


def _between(rng: np.random.Generator, low: float, high: float) -> float:
    return float(rng.uniform(low, high))


def _on_top(rng: np.random.Generator, width: float, height: float) -> list[Part]:
    """Up to four small things on a board of a width, its top at a height."""
    things: list[Part] = []
    for x in np.linspace(-0.36, 0.36, 4) * width:
        things += placed(_small_thing(rng), float(x), _between(rng, -0.05, 0.05), height)
    return things


def _small_thing(rng: np.random.Generator) -> list[Part]:
    kind = int(rng.integers(7))
    if kind == 0:
        return furniture.book_pile(rng, int(rng.integers(1, 6)), "books")
    if kind == 1:
        return [props.vase(_between(rng, 0.15, 0.4), "glaze" if rng.random() < 0.5 else "clay")]
    if kind == 2:
        return props.fruit_bowl(rng)
    if kind == 3:
        return props.table_lamp()
    if kind == 4:
        return props.palm(rng, _between(rng, 0.2, 0.4), pot_radius=0.07)
    if kind == 5:
        size = tuple(_between(rng, 0.08, 0.28) for _ in range(3))
        turn = _between(rng, 0.0, 90.0)
        return placed(box(size, (0, 0, 0), str(rng.choice(["carton", "metal"]))), 0, 0, 0, turn)
    return []


def sofa(rng: np.random.Generator) -> Piece:
    """Sofa for one to four."""
    pillows = tuple(rng.choice(["ikat", "print", "linen"], int(rng.integers(0, 4))))
    return Piece.standing(furniture.sofa(_between(rng, 1.0, 2.6), "sofa", pillows))


def armchair(_rng: np.random.Generator) -> Piece:
    """One-seat sofa."""
    return Piece.standing(furniture.armchair("armchair", "print"))


def bookcase(rng: np.random.Generator) -> Piece:
    """Open shelves full of books."""
    size = (_between(rng, 0.6, 1.4), _between(rng, 0.26, 0.36), _between(rng, 0.9, 2.3))
    return Piece.standing(furniture.bookcase(rng, size))


def sideboard(rng: np.random.Generator) -> Piece:
    """Low cupboard with things on it."""
    width, height = _between(rng, 0.8, 1.9), _between(rng, 0.55, 0.95)
    parts = furniture.sideboard((width, _between(rng, 0.36, 0.46), height))
    return Piece.standing(parts + _on_top(rng, width, height))


def wardrobe(rng: np.random.Generator) -> Piece:
    """Tall plain cupboard with two doors."""
    width, depth, height = (
        _between(rng, 0.9, 1.8),
        _between(rng, 0.45, 0.6),
        _between(rng, 1.7, 2.2),
    )
    parts = box((width, depth, height), (0, 0, 0), "oak", skip="-z")
    for side in (-1, 1):
        at = (side * width / 4, -depth / 2 - 0.009, 0.06)
        parts += box((width / 2 - 0.012, 0.018, height - 0.1), at, "sage", skip="+y")
        handle = (side * 0.05, -depth / 2 - 0.04, 0.5 * height)
        parts.append(tube(handle, (handle[0], handle[1], handle[2] + 0.18), 0.008, "brass"))
    return Piece.standing(parts)


def desk(rng: np.random.Generator) -> Piece:
    """Desk with a monitor, its keyboard and a chair before it."""
    width = _between(rng, 1.1, 1.8)
    parts = furniture.table((width, 0.7, 0.74), "oak", "metal")
    for x in (-0.25, 0.25) if width > 1.5 and rng.random() < 0.5 else (_between(rng, -0.2, 0.2),):
        parts += placed(_monitor(), x * width, 0.15, 0.74, _between(rng, -15, 15))
    parts += placed(box((0.42, 0.14, 0.02), (0, 0, 0), "black"), 0, -0.12, 0.74)
    parts += placed(_small_thing(rng), 0.4 * width, 0.1, 0.74)
    parts += placed(furniture.chair("linen"), _between(rng, -0.2, 0.2), -0.62, 0, 180)
    return Piece.standing(parts)


def _monitor() -> list[Part]:
    parts = box((0.24, 0.16, 0.012), (0, 0, 0), "black")
    parts.append(tube((0, 0.02, 0.01), (0, 0.02, 0.2), 0.02, "black"))
    parts += box((0.56, 0.03, 0.34), (0, 0, 0.14), "black", skip="-y")
    front = panel((-0.28, -0.016, 0.14), (0.56, 0, 0), (0, 0, 0.34), "screen", stretched=True)
    return [*parts, front]


def rack(rng: np.random.Generator) -> Piece:
    """Steel rack with cartons."""
    width, depth, height = _between(rng, 1.0, 2.2), 0.5, _between(rng, 1.4, 2.4)
    parts: list[Part] = []
    for x in (-1, 1):
        for y in (-1, 1):
            at = (x * (width / 2 - 0.02), y * (depth / 2 - 0.02), 0)
            parts += box((0.04, 0.04, height), at, "metal", skip="-z")
    for z in np.linspace(0.1, height - 0.06, 4):
        parts += box((width, depth, 0.03), (0, 0, float(z)), "metal", edge_m=0.12)
        parts += placed(_cartons_in_a_row(rng, width, depth), 0, 0, float(z) + 0.03)
    return Piece.standing(parts)


def _cartons_in_a_row(rng: np.random.Generator, width: float, depth: float) -> list[Part]:
    parts: list[Part] = []
    x = -width / 2 + 0.05
    while x < width / 2 - 0.3:
        w, h = _between(rng, 0.18, 0.45), _between(rng, 0.12, 0.34)
        if rng.random() < 0.7 and x + w < width / 2 - 0.03:
            kind = "carton" if rng.random() < 0.7 else "print"
            parts += box((w, _between(rng, 0.6, 0.9) * depth, h), (x + w / 2, 0, 0), kind)
        x += w + 0.05
    return parts


def cartons(rng: np.random.Generator) -> Piece:
    """Heap of cartons, each turned a little."""
    parts: list[Part] = []
    z, side = 0.0, _between(rng, 0.4, 0.7)
    for _ in range(int(rng.integers(1, 4))):
        high = _between(rng, 0.25, 0.5)
        crate = box((side, _between(rng, 0.7, 1.0) * side, high), (0, 0, 0), "carton")
        parts += placed(crate, 0, 0, z, _between(rng, -20, 20))
        z, side = z + high, 0.85 * side
    return Piece.standing(parts)


def plant(rng: np.random.Generator) -> Piece:
    """Pot plant on the floor."""
    if rng.random() < 0.5:
        return Piece.standing(props.palm(rng, _between(rng, 0.4, 0.7)))
    return Piece.standing(props.rubber_tree(rng, _between(rng, 0.9, 1.4)))


def standing_lamp(rng: np.random.Generator) -> Piece:
    """Floor lamp, lit."""
    return Piece.standing(props.floor_lamp(_between(rng, 1.4, 1.75)))


def basket(rng: np.random.Generator) -> Piece:
    """Wicker basket."""
    return Piece.standing(props.basket(_between(rng, 0.18, 0.28), _between(rng, 0.25, 0.45)))


def seat(rng: np.random.Generator) -> Piece:
    """Chair or footstool."""
    if rng.random() < 0.5:
        return Piece.standing(furniture.chair("linen"))
    return Piece.standing(furniture.pouf("print"))


def low_table(rng: np.random.Generator) -> Piece:
    """Coffee table with things on it."""
    size = (_between(rng, 0.8, 1.3), _between(rng, 0.5, 0.8), _between(rng, 0.35, 0.5))
    return Piece.standing(furniture.table(size, "oak", "walnut") + _on_top(rng, size[0], size[2]))


def dining_table(rng: np.random.Generator) -> Piece:
    """Table with two to six chairs."""
    width = _between(rng, 0.9, 1.9)
    parts = furniture.table((width, 0.85, 0.75), "oak", "oak") + _on_top(rng, width, 0.75)
    for x in np.linspace(-0.3, 0.3, int(rng.integers(1, 4))) * width:
        for side in (0.0, 180.0):
            y = 0.62 if side == 0.0 else -0.62
            turn = side + _between(rng, -12, 12)
            parts += placed(furniture.chair("linen"), float(x), y, 0, turn)
    return Piece.standing(parts)


def pillar(rng: np.random.Generator, height_m: float) -> Piece:
    """Column from floor to ceiling, round or square."""
    r = _between(rng, 0.12, 0.28)
    if rng.random() < 0.5:
        levels = np.linspace(0.0, height_m, 20)
        return Piece.standing([lathe([(r, float(z)) for z in levels], "wall9", sides=24)])
    return Piece.standing(
        box((2 * r, 2 * r, height_m), (0, 0, 0), "wall9", skip="-z +z", edge_m=0.12)
    )


def ball(rng: np.random.Generator) -> Piece:
    """Ball on the floor."""
    r = _between(rng, 0.1, 0.35)
    return Piece.standing([sphere(r, (0, 0, r), str(rng.choice(["print", "orange"])), sides=28)])


def bed(rng: np.random.Generator) -> Piece:
    """Bed with its head to the wall."""
    width, long = _between(rng, 0.9, 1.8), _between(rng, 1.9, 2.1)
    parts = box((width, long, 0.25), (0, 0, 0.05), "oak", skip="-z")
    parts += cushion((width, long, 0.22), (0, 0, 0.28), "linen", power=9)
    parts += cushion((width + 0.04, 0.65 * long, 0.24), (0, -0.17 * long, 0.29), "print", power=9)
    for x in (-0.25, 0.25) if width > 1.3 else (0.0,):
        at = (x * width, 0.38 * long, 0.46)
        parts += cushion((0.36 * width, 0.4, 0.16), at, "linen", power=3.2)
    head = (0, long / 2 - 0.03, 0.0)
    parts += box((width + 0.06, 0.05, _between(rng, 0.7, 1.1)), head, "walnut", skip="-z")
    return Piece.standing(parts)


def door(rng: np.random.Generator) -> Piece:
    """Panelled door in its frame."""
    return Piece.standing(
        props.door(_between(rng, 0.75, 1.0), _between(rng, 1.95, 2.1), "sage", "white")
    )


def artwork(rng: np.random.Generator) -> Piece:
    """Painting in a frame, one of six of a room."""
    name, frame = f"picture{rng.integers(6)}", str(rng.choice(["oak", "black", "walnut", "white"]))
    width, height = _between(rng, 0.25, 1.1), _between(rng, 0.25, 0.8)
    return Piece.hanging(props.framed_artwork(width, height, name, frame))


def wall_thing(rng: np.random.Generator) -> Piece:
    """Shelf, clock, switch, radiator-like grille or board on the wall."""
    kind = int(rng.integers(4))
    if kind == 0:
        return Piece.hanging(props.wall_shelf(rng, _between(rng, 0.6, 1.2)))
    if kind == 1:
        return Piece.hanging(props.clock(_between(rng, 0.12, 0.22), "brass"))
    if kind == 2:
        return Piece.hanging(box((0.09, 0.012, 0.09), (0, -0.006, -0.045), "white", skip="+y"))
    width, height = _between(rng, 0.5, 1.4), _between(rng, 0.4, 0.9)
    return Piece.hanging(box((width, 0.03, height), (0, -0.015, -height / 2), "metal", skip="+y"))


def radiator(rng: np.random.Generator) -> Piece:
    """Ribbed radiator on feet."""
    parts = props.radiator(_between(rng, 0.6, 1.6), _between(rng, 0.4, 0.7))
    return Piece.standing(parts)
