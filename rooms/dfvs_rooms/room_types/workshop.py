"""A workshop: benches, tools on the wall, machines, timber, tins of paint."""

import numpy as np

from dfvs_rooms.fittings import cupboards, shell, tools
from dfvs_rooms.fittings.shell import EAST, NORTH, SOUTH, WEST, Finish
from dfvs_rooms.generator import interior_furniture as pieces
from dfvs_rooms.generator import props
from dfvs_rooms.generator.layout import Layout, Piece
from dfvs_rooms.generator.solids import Part, box, corners, placed


def workshop(rng: np.random.Generator) -> Layout:
    """Furnish a workshop."""
    layout = shell.drawn_layout(rng, (6.0, 7.6), (4.8, 5.8), (2.9, 3.3))
    walls = ("bricks", "blockwork", "bricks", "wall0")
    shell.build_shell(layout, Finish("concrete", walls, skirting=""))
    shell.add_windows(layout, WEST, (-1.2, 1.0), 1.9, (1.6, 1.1), panes=4)
    _benches(layout, rng)
    layout.stand(Piece.standing(props.door(1.1, 2.1, "sage", "metal")), SOUTH, 1.9)
    layout.stand(Piece.standing(tools.leaning_boards(rng, 8)), SOUTH, -0.2)
    for what in (tools.tool_cabinet(), tools.drill_press(), tools.barrel("accent")):
        layout.against_wall(Piece.standing(what))
    layout.stand(_tin_rack(rng), SOUTH, -2.0)
    shell.scatter(layout, rng, (pieces.rack, pieces.cartons), 4)
    layout.set_down(_sawhorses(rng), 0.5, -0.5, float(rng.uniform(-20, 20)))
    layout.set_down(Piece.standing(tools.step_ladder(1.7)), -1.9, -0.7, float(rng.uniform(0, 90)))
    layout.in_the_middle(pieces.cartons(rng))
    for k, name in enumerate(("drawing0", "poster0", "drawing1", "poster1")):
        size = (0.42, 0.58) if name.startswith("poster") else (0.8, 0.6)
        layout.on_wall(shell.framed(name, size, "oak" if k else "black"), (1.5, 1.9))
    shell.hang_lamps(layout, (3, 2), 0.6, shade="sage")
    return layout


def _benches(layout: Layout, rng: np.random.Generator) -> None:
    """Bench and pegboard along the north wall; a second bench and shelves on the east."""
    width = float(rng.uniform(2.6, 3.2))
    s = float(rng.uniform(-0.6, 0.2))
    bench = tools.workbench(width)
    for x in np.linspace(-0.4, 0.42, 5) * width:
        bench += placed(_bench_thing(rng), float(x), 0.12, 0.9)
    bench += placed(box((0.5, 0.4, 0.32), (0, 0, 0), "carton"), 0.2 * width, 0.0, 0.275)
    bench += placed(box((0.6, 0.4, 0.22), (0, 0, 0), "chipboard"), -0.2 * width, 0.0, 0.275)
    layout.stand(Piece.standing(bench), NORTH, s)
    wall = Piece.hanging(tools.tool_wall(rng, width - 0.1, 1.0))
    layout.hang(wall, NORTH, s, 1.95)
    layout.stand(Piece.standing(tools.workbench(2.0)), EAST, 0.4)
    for z in (1.4, 1.8):
        parts = cupboards.open_shelf(1.8, "chipboard")
        for x in np.arange(-0.8, 0.85, 0.2):
            parts += placed(_paint_tin(rng), float(x), -0.12)
        layout.parts += shell.on_wall(layout, EAST, parts, 0.4, z)
    clock = Piece.hanging(props.clock(0.18, "black"))
    layout.hang(clock, EAST, 0.4, 2.45)


def _bench_thing(rng: np.random.Generator) -> list[Part]:
    kind = int(rng.integers(4))
    if kind == 0:
        return _paint_tin(rng)
    if kind == 1:
        size = [float(v) for v in rng.uniform(0.1, 0.26, 3)]
        return placed(box(size, (0, 0, 0), "accent"), 0, 0, 0, float(rng.uniform(0, 90)))
    if kind == 2:
        return placed(box((0.5, 0.09, 0.045), (0, 0, 0), "oak"), 0, -0.1, 0, 15.0)
    return placed(tools.spanner(0.25), 0, 0, 0.13)


def _paint_tin(rng: np.random.Generator) -> list[Part]:
    return shell.drawn_tin(rng, (0.06, 0.085), (0.12, 0.2), 5)


def _tin_rack(rng: np.random.Generator) -> Piece:
    """Steel shelves of paint tins."""
    width, depth, height = 1.5, 0.4, 1.9
    parts: list[Part] = []
    for post in corners(width / 2 - 0.02, depth / 2 - 0.02):
        parts += box((0.04, 0.04, height), (*post, 0), "metal", skip="-z", edge_m=0.15)
    for z in np.linspace(0.12, height - 0.35, 4):
        parts += box((width, depth, 0.03), (0, 0, float(z)), "metal", edge_m=0.12)
        for x in np.arange(-width / 2 + 0.12, width / 2 - 0.1, 0.19):
            if rng.random() < 0.85:
                y = float(rng.uniform(-0.08, 0.06))
                parts += placed(_paint_tin(rng), float(x), y, float(z) + 0.03)
    return Piece.standing(parts)


def _sawhorses(rng: np.random.Generator) -> Piece:
    """Two trestles with planks across."""
    parts: list[Part] = []
    for x in (-0.7, 0.7):
        parts += placed(box((0.08, 0.8, 0.08), (0, 0, 0.66), "oak"), x, 0)
        for y in (-0.32, 0.32):
            for lean in (-0.16, 0.16):
                leg = box((0.05, 0.05, 0.68), (lean, y, 0), "oak", skip="-z", edge_m=0.2)
                parts += placed(leg, x, 0)
    for y in (-0.25, -0.02, 0.22):
        board = box((2.2, 0.19, 0.03), (0, 0, 0), "planks", edge_m=0.12)
        parts += placed(board, float(rng.uniform(-0.1, 0.1)), y, 0.74, float(rng.uniform(-4, 4)))
    return Piece.standing(parts + placed(_paint_tin(rng), 0.4, 0.0, 0.775))
