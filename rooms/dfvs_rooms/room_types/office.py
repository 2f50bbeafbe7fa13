"""An office: desks back to back, boards full of writing, shelves of files, a printer."""

import numpy as np

from dfvs_rooms.fittings import shell
from dfvs_rooms.fittings.bookcases import bookcase
from dfvs_rooms.fittings.shell import EAST, NORTH, SOUTH, WEST, Finish
from dfvs_rooms.generator import furniture, props
from dfvs_rooms.generator import interior_furniture as pieces
from dfvs_rooms.generator.layout import Layout, Piece
from dfvs_rooms.generator.solids import Part, box, cushion, lathe, panel, placed, tube


def office(rng: np.random.Generator) -> Layout:
    """Furnish an office."""
    layout = shell.drawn_layout(rng, (5.4, 6.8), (4.4, 5.4), (2.6, 2.9))
    shell.build_shell(layout, Finish("carpet", ("wall0", "wall1", "wall0", "wall0")))
    shell.add_windows(layout, WEST, (-1.2, 1.0), 1.55, (1.5, 1.3), panes=2)
    layout.hang(shell.framed("whiteboard", (1.8, 1.2), "steel"), NORTH, -0.9, 1.55)
    layout.hang(shell.framed("noticeboard", (1.5, 1.0), "oak"), EAST, 0.9, 1.6)
    layout.stand(Piece.standing(props.door(0.95, 2.05, "oak", "white")), SOUTH, 1.8)
    for k, s in enumerate((1.0, 2.0)):
        case = bookcase(rng, (0.95, 0.34, 1.9), "white", f"files{k}")
        layout.stand(Piece.standing(case), NORTH, s)
    layout.stand(Piece.standing(_cabinet_and_printer()), EAST, -1.3)
    turn = float(rng.choice([0.0, 90.0]))
    layout.set_down(_desks(rng), float(rng.uniform(-0.6, 0.2)), -0.35, turn)
    layout.stand(pieces.desk(rng), SOUTH, -1.4)
    for k in range(3):
        layout.hang(shell.framed(f"poster{k}", (0.42, 0.6), "black"), SOUTH, 0.9 * k - 1.9, 1.75)
    shell.scatter(layout, rng, (pieces.plant, pieces.cartons, pieces.seat), 4)
    layout.hang(Piece.hanging(props.clock(0.17, "black")), SOUTH, 1.0, 2.2)
    shell.hang_lamps(layout, (2, 2), 0.45)
    return layout


def _desks(rng: np.random.Generator) -> Piece:
    """Two desks face to face with a low screen between, and two office chairs."""
    parts: list[Part] = []
    for side, turn in ((-1, 0.0), (1, 180.0)):
        desk = furniture.table((1.7, 0.78, 0.74), "oak", "metal")
        desk += placed(
            _monitor(f"screen{int(side > 0)}"), 0.1, 0.2, 0.74, float(rng.uniform(-9, 9))
        )
        desk += placed(box((0.44, 0.14, 0.02), (0, 0, 0), "black"), 0.08, -0.12, 0.74)
        desk += placed(box((0.21, 0.3, 0.012), (0, 0, 0), "white"), -0.5, -0.05, 0.74, 12.0)
        desk += placed([_mug()], 0.6, -0.1, 0.74)
        pile = furniture.book_pile(rng, int(rng.integers(2, 6)), "files0")
        desk += placed(pile, -0.62, 0.18, 0.74)
        desk += placed(_office_chair(), 0.0, -0.78, 0, 180.0 + float(rng.uniform(-30, 30)))
        parts += placed(desk, 0, side * 0.4, 0, turn)
    parts += box((1.7, 0.03, 0.42), (0, 0, 0.74), "sofa")
    return Piece.standing(parts)


def _monitor(screen: str) -> list[Part]:
    parts = box((0.24, 0.18, 0.012), (0, 0, 0), "black")
    parts.append(tube((0, 0.02, 0.01), (0, 0.02, 0.2), 0.02, "black"))
    parts += box((0.62, 0.03, 0.37), (0, 0, 0.13), "black", skip="-y")
    face = panel((-0.3, -0.016, 0.14), (0.6, 0, 0), (0, 0, 0.35), screen, stretched=True)
    return [*parts, face, *box((0.62, 0.004, 0.37), (0, -0.013, 0.13), "black", skip="+y")]


def _mug() -> Part:
    return lathe([(0.035, 0.0), (0.04, 0.09), (0.036, 0.09), (0.03, 0.02)], "accent", sides=16)


def _office_chair() -> list[Part]:
    """Swivel chair on five castors, its back to +y."""
    parts = cushion((0.5, 0.48, 0.09), (0, 0, 0.44), "sofa", power=5)
    parts += cushion((0.46, 0.08, 0.56), (0, 0.25, 0.56), "sofa", power=5)
    parts.append(tube((0, 0, 0.08), (0, 0, 0.45), 0.03, "steel"))
    for angle in np.arange(5) * 2 * np.pi / 5:
        end = (0.3 * np.cos(angle), 0.3 * np.sin(angle), 0.05)
        parts.append(tube((0, 0, 0.1), end, (0.025, 0.018), "black", sides=8))
        parts += cushion((0.05, 0.05, 0.05), (end[0], end[1], 0), "black", power=2.5)
    for x in (-0.27, 0.27):
        parts += box((0.05, 0.26, 0.03), (x, 0.02, 0.68), "black")
        parts += box((0.03, 0.04, 0.2), (x, 0.05, 0.48), "black", edge_m=0.2)
    return parts


def _cabinet_and_printer() -> list[Part]:
    """Low metal cabinet of drawers with a printer on top."""
    parts = box((1.2, 0.5, 0.72), (0, 0, 0), "steel", skip="-z")
    for x in (-0.3, 0.3):
        for z in (0.04, 0.27, 0.5):
            parts += box((0.57, 0.02, 0.2), (x, -0.26, z), "sage", skip="+y")
            parts += box((0.16, 0.02, 0.02), (x, -0.28, z + 0.13), "black", edge_m=0.2)
    parts += box((0.5, 0.44, 0.26), (-0.2, 0, 0.72), "white")
    parts += box((0.44, 0.38, 0.05), (-0.2, 0, 0.98), "metal")
    parts += box((0.34, 0.12, 0.02), (-0.2, -0.26, 0.82), "black")
    return parts + placed(box((0.3, 0.24, 0.2), (0, 0, 0), "carton"), 0.35, 0.02, 0.72, 8.0)
