"""A school corridor: lockers, doors, notice boards, tiles up to the shoulder."""

import numpy as np

from dfvs_rooms.fittings import shell
from dfvs_rooms.fittings.shell import EAST, NORTH, SOUTH, WEST, Finish
from dfvs_rooms.generator import interior_furniture as pieces
from dfvs_rooms.generator import props
from dfvs_rooms.generator.layout import Layout, Piece
from dfvs_rooms.generator.solids import Part, box, cushion, lathe, placed, tube

_TILED_M = 1.25


def passage(rng: np.random.Generator) -> Layout:
    """Furnish a corridor."""
    layout = shell.drawn_layout(rng, (8.5, 10.5), (2.7, 3.2), (2.8, 3.1))
    floor = str(rng.choice(["terrazzo", "flagstone"]))
    shell.build_shell(layout, Finish(floor, ("wall0", "wall0", "wall0", "wall0")))
    for k in (NORTH, EAST, SOUTH, WEST):
        reach = layout.walls[k].length_m / 2
        shell.clad(layout, k, (-reach, reach, 0.09, _TILED_M), "subway", 0.012)
        shell.clad(layout, k, (-reach, reach, _TILED_M, _TILED_M + 0.05), "sage", 0.02)
    shell.add_window(layout, WEST, (0.3, 1.75), (1.3, 0.95), panes=2)
    layout.stand(Piece.standing(_double_door()), EAST, 0.0)
    _north_side(layout, rng)
    _south_side(layout, rng)
    shell.hang_lamps(layout, (4, 1), 0.35)
    return layout


def _north_side(layout: Layout, rng: np.random.Generator) -> None:
    """Two blocks of lockers with boards between."""
    reach = layout.walls[NORTH].length_m / 2
    first = -reach + 1.35 + float(rng.uniform(0.0, 0.4))
    last = reach - 1.0 - float(rng.uniform(0.0, 0.4))
    layout.stand(Piece.standing(_lockers(rng, 7)), NORTH, first)
    layout.stand(Piece.standing(_lockers(rng, 5)), NORTH, last)
    between = 0.5 * (first + last) + 0.2
    layout.hang(shell.framed("noticeboard0", (1.6, 1.05), "oak"), NORTH, between, 1.95)
    layout.stand(Piece.standing(_bench()), NORTH, between)
    layout.hang(shell.framed("poster0", (0.5, 0.7), "black"), NORTH, between - 1.35, 1.85)


def _south_side(layout: Layout, rng: np.random.Generator) -> None:
    """Doors of class rooms with what hangs between them."""
    reach = layout.walls[SOUTH].length_m / 2
    for j, s in enumerate((-0.68, 0.02, 0.7)):
        at = s * reach + float(rng.uniform(-0.2, 0.2))
        layout.stand(Piece.standing(_class_door(rng)), SOUTH, at)
        layout.hang(shell.framed(f"label{j}", (0.34, 0.085), "black"), SOUTH, at, 2.3)
    layout.stand(Piece.standing(props.radiator(1.2, 0.5)), SOUTH, 0.36 * reach)
    layout.hang(Piece.hanging(_coats(rng)), SOUTH, -0.34 * reach, 1.6)
    layout.hang(shell.framed("noticeboard1", (1.0, 0.7), "oak"), SOUTH, 0.36 * reach, 1.95)
    layout.hang(Piece.hanging(_extinguisher()), SOUTH, 0.93 * reach, 0.9)
    layout.hang(shell.framed("chart", (0.8, 0.6), "walnut"), WEST, -0.85, 1.9)
    for name in ("poster1", "poster2", "poster3", "picture0", "picture1"):
        layout.on_wall(shell.framed(name, (0.42, 0.6), "white"), (1.75, 1.95))
    shell.scatter(layout, rng, (pieces.plant, pieces.seat), 3)


def _lockers(rng: np.random.Generator, count: int) -> list[Part]:
    """Tall lockers side by side, with vents and plates."""
    wide, deep, high = 0.36, 0.45, 1.8
    parts = box((count * wide, deep, high), (0, 0, 0.1), "metal")
    parts += box((count * wide, deep - 0.08, 0.1), (0, 0.04, 0), "black", skip="-z")
    for k in range(count):
        x = wide * (k + 0.5 - count / 2)
        paint = "accent" if rng.random() < 0.25 else "sage"
        door = (x, -deep / 2 - 0.008, 0.12)
        parts += box((wide - 0.014, 0.016, high - 0.04), door, paint, skip="+y")
        for z in (0.26, 0.3, 0.34, 1.64, 1.68, 1.72):
            parts += box((0.2, 0.006, 0.014), (x, -deep / 2 - 0.019, z), "black", edge_m=0.3)
        plate = (x, -deep / 2 - 0.02, 1.5)
        parts += box((0.09, 0.008, 0.05), plate, "white", skip="+y", edge_m=0.3)
        grip = (x + 0.11, -deep / 2 - 0.03, 1.0)
        parts += box((0.025, 0.03, 0.14), grip, "steel", edge_m=0.3)
        if rng.random() < 0.35:
            sticker = (x - 0.03, -deep / 2 - 0.018, 1.2 + float(rng.uniform(-0.1, 0.1)))
            parts += box((0.14, 0.004, 0.14), sticker, "print", skip="+y", edge_m=0.3)
    return parts


def _class_door(rng: np.random.Generator) -> list[Part]:
    """Door with a pane in its upper half and a timetable."""
    parts = props.door(0.95, 2.1, "oak", "white")
    parts += box((0.5, 0.02, 0.6), (0.0, -0.045, 1.25), "pane", skip="+y")
    if rng.random() < 0.7:
        parts += box((0.2, 0.004, 0.28), (-0.25, -0.06, 1.3), "white", skip="+y", edge_m=0.3)
    return parts


def _double_door() -> list[Part]:
    parts: list[Part] = []
    for x in (-0.46, 0.46):
        parts += placed(props.door(0.86, 2.15, "accent", "white"), x, 0)
        parts += placed(box((0.4, 0.02, 0.75), (0, -0.045, 1.2), "pane", skip="+y"), x, 0)
    return parts


def _bench() -> list[Part]:
    parts = box((1.5, 0.36, 0.05), (0, 0, 0.42), "oak")
    for x in (-0.6, 0.6):
        parts += box((0.05, 0.3, 0.42), (x, 0, 0), "metal", skip="-z")
    bag = cushion((0.36, 0.2, 0.34), (0.3, 0, 0.47), "print", power=4)
    return parts + bag


def _coats(rng: np.random.Generator) -> list[Part]:
    """Board of hooks with coats and bags."""
    parts = box((1.5, 0.025, 0.12), (0, -0.012, 0.1), "oak", skip="+y")
    for k, x in enumerate(np.linspace(-0.62, 0.62, 6)):
        hook = (float(x), -0.08, 0.15)
        parts.append(tube((hook[0], -0.02, 0.13), hook, 0.008, "brass", sides=6))
        if rng.random() < 0.75:
            cloth = ("sofa", "armchair", "linen", "print")[k % 4]
            high = float(rng.uniform(0.35, 0.75))
            coat = cushion((0.22, 0.13, high), (hook[0], -0.09, 0.14 - high), cloth, power=2.8)
            parts += coat
    return parts


def _extinguisher() -> list[Part]:
    body = [(0.01, -0.25), (0.07, -0.25), (0.075, 0.1), (0.05, 0.17), (0.02, 0.2), (0.02, 0.26)]
    parts = placed([lathe(body, "red", sides=18)], 0, -0.1)
    parts += box((0.03, 0.12, 0.04), (0, -0.1, 0.24), "black", edge_m=0.3)
    return [*parts, tube((0.03, -0.1, 0.25), (0.09, -0.12, -0.1), 0.012, "black", sides=7)]
