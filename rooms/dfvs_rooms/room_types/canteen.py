"""A canteen: a large hall with columns, rows of tables, a counter under menu boards."""

import numpy as np

from dfvs_rooms.fittings import shell
from dfvs_rooms.fittings.shell import EAST, NORTH, SOUTH, WEST, Finish
from dfvs_rooms.generator import furniture, props
from dfvs_rooms.generator import interior_furniture as pieces
from dfvs_rooms.generator.layout import Layout, Piece
from dfvs_rooms.generator.solids import Part, box, lathe, placed, tube


def canteen(rng: np.random.Generator) -> Layout:
    """Furnish a canteen."""
    layout = shell.drawn_layout(rng, (9.0, 11.0), (7.0, 8.4), (3.3, 3.9))
    floor = str(rng.choice(["checkers", "flagstone", "terrazzo"]))
    shell.build_shell(layout, Finish(floor, ("bricks", "wall0", "wall0", "wall1")), edge_m=0.14)
    for k in (EAST, SOUTH, WEST):
        reach = layout.walls[k].length_m / 2
        shell.clad(layout, k, (-reach, reach, 0.09, 1.0), "wainscot")
    shell.add_windows(layout, SOUTH, (-3.0, 0.0, 3.0), 2.0, (2.0, 1.6), panes=3)
    _counter(layout, rng)
    e, n = (float(v) for v in layout.half)
    for x in (-0.36 * e, 0.36 * e):
        layout.set_down(Piece.standing(_column(layout.height_m)), x, 0.25 * n)
    for x in (-0.62, 0.0, 0.62):
        for y in (-0.5, 0.08):
            if rng.random() < 0.85:
                layout.set_down(_table(rng), x * e, y * n, float(rng.choice([0.0, 90.0])))
    layout.stand(Piece.standing(props.door(1.4, 2.2, "accent", "white")), WEST, -1.5)
    layout.hang(shell.framed("noticeboard", (1.6, 1.05), "oak"), WEST, 1.2, 1.75)
    names = [shell.framed(f"picture{j}", (0.9, 0.65), "black") for j in range(4)]
    shell.hang_row(layout, EAST, names, 1.8)
    shell.scatter(layout, rng, (pieces.plant, pieces.plant, pieces.seat, pieces.radiator), 5)
    shell.hang_lamps(layout, (4, 3), 1.0, shade="accent")
    return layout


def _column(height: float) -> list[Part]:
    """Square column, tiled up to the shoulder."""
    parts = box((0.42, 0.42, height), (0, 0, 0), "wall1", skip="-z +z", edge_m=0.14)
    return parts + box((0.45, 0.45, 1.35), (0, 0, 0), "subway", skip="-z", edge_m=0.14)


def _counter(layout: Layout, rng: np.random.Generator) -> None:
    """Counter with a till, jars and cakes before shelves; menu boards above."""
    length = float(rng.uniform(4.0, 5.0))
    s = float(rng.uniform(-1.0, 1.0))
    front = box((length, 0.7, 1.02), (0, 0, 0), "wainscot", skip="-z")
    front += box((length + 0.1, 0.8, 0.05), (0, 0, 1.02), "worktop")
    front += placed(_coffee_machine(), -0.34 * length, 0.05, 1.07)
    for x in np.linspace(-0.18, 0.2, 5) * length:
        front += placed(_served(rng), float(x), float(rng.uniform(-0.15, 0.1)), 1.07)
    front += placed(_till(), 0.36 * length, 0.0, 1.07)
    y = float(layout.half[1]) - 1.55
    layout.set_down(Piece.standing(front), s, y)
    back = box((length, 0.45, 0.92), (0, 0, 0), "sage", skip="-z")
    back += box((length, 0.48, 0.03), (0, 0, 0.92), "oak")
    for x in np.arange(-length / 2 + 0.2, length / 2 - 0.15, 0.24):
        back += placed(_jar(rng), float(x), 0.0, 0.95)
    layout.stand(Piece.standing(back), NORTH, s)
    for j, x in enumerate((-1.3, 0.0, 1.3)):
        layout.hang(shell.framed(f"menu{j}", (1.15, 0.76), "oak"), NORTH, s + x, 2.3)


def _jar(rng: np.random.Generator) -> list[Part]:
    return shell.drawn_tin(rng, (0.06, 0.09), (0.15, 0.3), 6)


def _served(rng: np.random.Generator) -> list[Part]:
    kind = int(rng.integers(3))
    if kind == 0:
        return props.fruit_bowl(rng)
    if kind == 1:
        stand = [(0.08, 0.0), (0.02, 0.02), (0.02, 0.12), (0.16, 0.14), (0.16, 0.15), (0.01, 0.15)]
        cake = [(0.13, 0.15), (0.135, 0.24), (0.12, 0.25), (0.005, 0.25)]
        return [lathe(stand, "white"), lathe(cake, "clay")]
    return _jar(rng)


def _coffee_machine() -> list[Part]:
    parts = box((0.7, 0.5, 0.14), (0, 0, 0.04), "black")
    parts += box((0.7, 0.3, 0.36), (0, 0.1, 0.18), "steel")
    parts += box((0.7, 0.5, 0.1), (0, 0, 0.46), "steel")
    for x in (-0.2, 0.05, 0.25):
        parts.append(tube((x, -0.12, 0.36), (x, -0.12, 0.47), 0.03, "metal"))
        parts.append(tube((x, -0.12, 0.37), (x, -0.32, 0.34), 0.014, "black", sides=8))
    for x in np.linspace(-0.28, 0.28, 6):
        cup = lathe([(0.025, 0.0), (0.04, 0.07), (0.035, 0.07)], "white", sides=14)
        parts += placed([cup], float(x), 0.05, 0.56)
    return parts


def _till() -> list[Part]:
    parts = box((0.36, 0.4, 0.12), (0, 0, 0), "metal")
    parts += placed(box((0.34, 0.03, 0.26), (0, 0, 0), "black"), 0, 0.05, 0.12)
    return parts + box((0.3, 0.004, 0.2), (0, 0.03, 0.15), "screen0", skip="+y")


def _table(rng: np.random.Generator) -> Piece:
    """Table for four with things on it."""
    parts = furniture.table((1.3, 0.8, 0.75), "oak", "metal")
    for x in (-0.35, 0.35):
        for side, turn in ((1, 0.0), (-1, 180.0)):
            chair = furniture.chair("armchair")
            parts += placed(chair, x, side * 0.6, 0, turn + float(rng.uniform(-10, 10)))
    parts += placed(props.palm(rng, 0.2, pot_radius=0.06), 0, 0, 0.75)
    parts += placed(_jar(rng), 0.18, 0.05, 0.75)
    tray = box((0.4, 0.3, 0.02), (0, 0, 0), "accent")
    return Piece.standing(parts + placed(tray, -0.35, -0.15, 0.75, float(rng.uniform(-20, 20))))
