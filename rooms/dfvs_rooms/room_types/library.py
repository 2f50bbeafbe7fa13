"""A library: bookcases along the walls and across the room, reading tables, leather chairs."""

import numpy as np

from dfvs_rooms.fittings import shell
from dfvs_rooms.fittings.bookcases import bookcase
from dfvs_rooms.fittings.shell import EAST, NORTH, SOUTH, WEST, Finish
from dfvs_rooms.generator import furniture, props
from dfvs_rooms.generator import interior_furniture as pieces
from dfvs_rooms.generator.layout import Layout, Piece
from dfvs_rooms.generator.solids import Part, box, lathe, placed, sphere, tilted, tube

_HIGH_M = 2.5


def library(rng: np.random.Generator) -> Layout:
    """Furnish a library."""
    layout = shell.drawn_layout(rng, (7.0, 8.4), (5.2, 6.2), (3.2, 3.6))
    finish = Finish("parquet", ("wall0", "wall0", "wall1", "wall0"), skirting="walnut")
    shell.build_shell(layout, finish)
    shell.add_windows(layout, SOUTH, (-2.2, 0.0, 2.2), 1.9, (1.1, 1.9), panes=2)
    _along_walls(layout, rng)
    for x in (-1.9, 1.7)[: int(rng.integers(1, 3))]:
        layout.set_down(_double_case(rng), x, 0.55, 90.0)
    layout.set_down(_reading_table(rng), -0.1, -1.2)
    layout.set_down(Piece.standing(_globe_on_stand()), 2.6, -1.7)
    for x, turn in ((-2.8, -140.0), (-2.9, 30.0)):
        chair = furniture.sofa(0.98, "leather", ("print",))
        layout.set_down(Piece.standing(chair), x, -1.7 if turn < 0 else -0.4, turn)
    layout.stand(Piece.standing(props.door(1.0, 2.15, "walnut", "walnut")), EAST, -1.9)
    for s in (-1.1, 1.1):
        layout.hang(shell.framed(f"picture{round(s + 2)}", (0.5, 0.7), "walnut"), SOUTH, s, 1.8)
    for k in (NORTH, WEST):
        names = [f"picture{j + 3 * k}" for j in range(4)]
        row = [shell.framed(name, (0.62, 0.42), "brass") for name in names]
        shell.hang_row(layout, k, row, 2.9)
    layout.parts += shell.on_wall(layout, NORTH, _ladder(), 0.6)
    shell.scatter(layout, rng, (pieces.plant, pieces.armchair, pieces.basket), 3)
    shell.hang_lamps(layout, (3, 2), 0.9)
    return layout


def _along_walls(layout: Layout, rng: np.random.Generator) -> None:
    """Bookcases side by side along three walls."""
    for k in (NORTH, WEST, EAST):
        wall = layout.walls[k]
        width = 1.03
        count = int((wall.length_m - (0.9 if k != NORTH else 0.2)) / width)
        for j in range(count):
            s = width * (j + 0.5) - width * count / 2
            if k == EAST and s < -1.2:
                continue
            name = f"books{int(rng.integers(3))}"
            case = bookcase(rng, (1.0, 0.3, _HIGH_M), "walnut", name)
            cornice = box((1.0, 0.34, 0.06), (0, -0.01, _HIGH_M), "walnut")
            layout.stand(Piece.standing(case + cornice), k, s)


def _double_case(rng: np.random.Generator) -> Piece:
    """Two lower bookcases back to back, twice as long."""
    parts: list[Part] = []
    for x in (-0.51, 0.51):
        for turn in (0.0, 180.0):
            y = -0.15 if turn == 0.0 else 0.15
            case = bookcase(rng, (1.0, 0.28, 1.45), "oak", f"books{rng.integers(3)}")
            parts += placed(case, x, y, 0, turn)
    parts += box((2.1, 0.66, 0.035), (0, 0, 1.45), "oak")
    parts += placed(furniture.book_pile(rng, 5, "books0"), -0.4, 0, 1.485)
    return Piece.standing(parts + placed([props.vase(0.34, "glaze")], 0.5, 0, 1.485))


def _reading_table(rng: np.random.Generator) -> Piece:
    """Long table with lamps, open books and chairs on both sides."""
    parts = furniture.table((2.4, 1.0, 0.76), "walnut", "walnut")
    for x in (-0.7, 0.7):
        parts += placed(_desk_lamp(), x, 0.0, 0.76)
    for x in (-0.95, -0.3, 0.35, 0.95):
        pile = furniture.book_pile(rng, int(rng.integers(1, 6)), f"books{rng.integers(3)}")
        parts += placed(pile, x, float(rng.uniform(-0.25, 0.25)), 0.76, float(rng.uniform(0, 90)))
    for x in (-0.75, 0.0, 0.75):
        for side in (1, -1):
            turn = (0.0 if side > 0 else 180.0) + float(rng.uniform(-15, 15))
            parts += placed(furniture.chair("leather"), x, side * 0.74, 0, turn)
    return Piece.standing(parts)


def _desk_lamp() -> list[Part]:
    """Banker's lamp with a coloured shade."""
    parts = [lathe([(0.09, 0.0), (0.09, 0.02), (0.015, 0.04)], "brass")]
    parts.append(tube((0, 0, 0.03), (0, 0, 0.34), 0.01, "brass", sides=8))
    arch = [(0.07 * np.cos(a), 0.34 + 0.07 * np.sin(a)) for a in np.linspace(0, np.pi, 9)]
    shade = lathe([(0.08, -0.16), (0.08, 0.16)], "glaze", sides=14, is_sheet=True)
    half = tilted(shade, (0, 1, 0), 90)
    return [*parts, *placed([half], 0, 0, arch[4][1])]


def _globe_on_stand() -> list[Part]:
    """Terrestrial globe in a wooden stand."""
    ball = sphere(0.3, (0, 0, 0.85), "chart", sides=36)
    ring = lathe([(0.32, 0.84), (0.38, 0.84), (0.38, 0.87), (0.32, 0.87)], "walnut", sides=36)
    parts = [ball, ring]
    for angle in np.radians([0, 90, 180, 270]):
        x, y = 0.35 * np.cos(angle), 0.35 * np.sin(angle)
        parts.append(tube((0.7 * x, 0.7 * y, 0.0), (x, y, 0.85), (0.02, 0.028), "walnut", sides=8))
    return parts


def _ladder() -> list[Part]:
    """Library ladder that leans against the shelves of a wall."""
    parts = []
    for x in (-0.22, 0.22):
        parts.append(tube((x, -0.95, 0.0), (x, -0.36, 2.5), 0.02, "oak", sides=8))
    for t in np.linspace(0.1, 0.92, 8):
        y, z = -0.95 + 0.59 * t, 2.5 * t
        parts += box((0.44, 0.09, 0.025), (0, float(y), float(z)), "oak", edge_m=0.2)
    return parts
