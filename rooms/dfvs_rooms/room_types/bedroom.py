"""A bedroom: a bed between two bedside tables, wardrobes, drawers, an armchair by the window."""

import numpy as np

from dfvs_rooms.fittings import shell
from dfvs_rooms.fittings.cupboards import front
from dfvs_rooms.fittings.shell import EAST, NORTH, SOUTH, WEST, Finish
from dfvs_rooms.generator import furniture, props
from dfvs_rooms.generator import interior_furniture as pieces
from dfvs_rooms.generator.layout import Layout, Piece
from dfvs_rooms.generator.solids import box, corners, cushion, placed, tube


def bedroom(rng: np.random.Generator) -> Layout:
    """Furnish a bedroom."""
    layout = shell.drawn_layout(rng, (4.6, 5.6), (4.0, 4.8), (2.5, 2.8))
    shell.build_shell(layout, Finish("planks", ("wallpaper", "wall0", "wall0", "wall0")))
    window = (float(rng.uniform(-0.5, 0.6)), 1.45)
    shell.add_window(layout, WEST, window, (1.5, 1.4), panes=2)
    shell.add_curtains(layout, WEST, window, 1.5, rng)
    bed = float(rng.uniform(-0.35, 0.35))
    layout.stand(_bed(rng), NORTH, bed)
    for side in (-1, 1):
        layout.stand(_bedside_table(rng), NORTH, bed + side * 1.22)
        layout.hang(shell.framed(f"picture{side + 1}", (0.34, 0.46), "oak"), NORTH, bed + side, 1.6)
    layout.hang(shell.framed("picture4", (0.9, 0.6), "walnut"), NORTH, bed, 1.72)
    layout.stand(_wardrobe(rng), EAST, float(rng.uniform(-0.5, 0.3)))
    layout.stand(_drawers(rng), SOUTH, float(rng.uniform(-0.9, -0.3)))
    layout.stand(Piece.standing(props.door(0.86, 2.05, "white", "white")), SOUTH, 1.55)
    for k, s in enumerate((-1.5, -0.85, -0.1, 0.6)):
        size = (0.4, 0.52) if k % 2 else (0.56, 0.42)
        layout.hang(shell.framed(f"picture{k + 3}", size, "black"), SOUTH, s, 1.62)
    layout.set_down(Piece.standing(furniture.armchair("armchair", "print")), -1.5, -1.25, -125.0)
    shell.scatter(layout, rng, (pieces.plant, pieces.basket, pieces.seat, pieces.standing_lamp), 5)
    for _ in range(2):
        layout.on_wall(pieces.wall_thing(rng), (1.3, 1.8))
    layout.parts += placed(props.rug("rug", 2.5, 1.7), bed, -0.25)
    shell.hang_lamps(layout, (1, 1), 0.5)
    return layout


def _bed(rng: np.random.Generator) -> Piece:
    """Double bed with a buttoned head, a throw and four pillows."""
    width, long = float(rng.uniform(1.5, 1.7)), 2.05
    parts = box((width, long, 0.22), (0, 0, 0.08), "oak", skip="-z")
    parts += cushion((width, long, 0.26), (0, 0, 0.28), "linen", power=9)
    parts += cushion((width + 0.05, 1.3, 0.25), (0, -0.36, 0.3), "sofa", power=9)
    parts += cushion((width + 0.09, 0.55, 0.27), (0, -0.7, 0.295), "print", power=9)
    for x in (-0.24, 0.24):
        parts += cushion((0.42 * width, 0.42, 0.17), (x * width, 0.72, 0.5), "linen", power=3.2)
        parts += cushion((0.3 * width, 0.2, 0.32), (x * width, 0.42, 0.52), "ikat", power=3.2)
    for column in range(4):
        at = (width * ((column + 0.5) / 4 - 0.5), long / 2 + 0.03, 0.3)
        parts += cushion((width / 4, 0.11, 0.85), at, "armchair", power=9)
    return Piece.standing(parts)


def _bedside_table(rng: np.random.Generator) -> Piece:
    parts = box((0.46, 0.38, 0.42), (0, 0, 0.12), "oak")
    for z in (0.14, 0.34):
        parts += placed(front(0.42, 0.18, "sage", handle="drawer"), 0, -0.19, z)
    for leg in corners(0.18, 0.14):
        parts.append(tube((*leg, 0), (*leg, 0.12), 0.014, "walnut", sides=7))
    parts += placed(props.table_lamp(), -0.08, 0.06, 0.54)
    books = furniture.book_pile(rng, int(rng.integers(1, 4)), "books")
    return Piece.standing(parts + placed(books, 0.12, -0.06, 0.54))


def _wardrobe(rng: np.random.Generator) -> Piece:
    """Four doors of boarding in a wooden frame."""
    width, depth, height = float(rng.uniform(1.8, 2.2)), 0.6, 2.1
    parts = box((width, depth, height), (0, 0, 0), "oak", skip="-z")
    for k in range(4):
        w = (width - 0.06) / 4
        x = -width / 2 + 0.03 + w * (k + 0.5)
        parts += box((w - 0.01, 0.02, height - 0.16), (x, -depth / 2 - 0.01, 0.1), "wainscot")
        grip = (x + (0.4 * w if k % 2 == 0 else -0.4 * w), -depth / 2 - 0.05, 1.0)
        parts.append(tube(grip, (grip[0], grip[1], 1.22), 0.008, "brass", sides=7))
    for x in (-0.5, 0.45):
        crate = box((0.5, 0.4, 0.28), (0, 0, 0), "wicker" if x < 0 else "carton")
        parts += placed(crate, x, 0, height, float(rng.uniform(-8, 8)))
    return Piece.standing(parts)


def _drawers(rng: np.random.Generator) -> Piece:
    """Chest of drawers with things on it."""
    width, depth, height = 1.25, 0.46, 0.86
    parts = box((width, depth, height - 0.08), (0, 0, 0.08), "walnut")
    for column in (-1, 1):
        for row in range(3):
            drawer = front(0.6, 0.24, "oak", handle="drawer")
            parts += placed(drawer, column * 0.305, -depth / 2, 0.1 + 0.25 * row)
    parts += placed([props.vase(0.32, "clay")], -0.42, 0, height)
    parts += placed(furniture.book_pile(rng, 4, "books"), 0.05, 0, height)
    return Piece.standing(parts + placed(props.palm(rng, 0.32, 0.08), 0.42, 0, height))
