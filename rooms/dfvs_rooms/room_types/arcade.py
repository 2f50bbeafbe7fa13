"""An arcade: what repeats in buildings, repeated exactly, so that places are taken for others.

Equal windows, shelves of equal books, equal balusters, equal pictures and tiles, each at one
distance. A small thing of its own on every bookcase, on some windows and in place of some pictures
is all that tells its places apart.
"""

import numpy as np

from dfvs_core.geometry.arrays import FloatArray
from dfvs_rooms.fittings import shell
from dfvs_rooms.fittings.bookcases import bookcase
from dfvs_rooms.fittings.shell import EAST, NORTH, SOUTH, WEST, Finish
from dfvs_rooms.generator import interior_furniture as pieces
from dfvs_rooms.generator import props
from dfvs_rooms.generator.layout import Layout, Piece
from dfvs_rooms.generator.solids import Part, box, lathe, placed

_SILL_M, _TILED_M = 1.55, 0.75
_SHELVES_M = (1.0, 0.3, 2.3)
_RAIL_M = 0.95
_BALUSTER = ((0.035, 0.0), (0.035, 0.12), (0.018, 0.16), (0.045, 0.42), (0.018, 0.72), (0.03, 0.8))
"""Outline (radius, height) of a baluster, m."""


def arcade(rng: np.random.Generator) -> Layout:
    """Furnish a hall in which everything comes again and again."""
    layout = shell.drawn_layout(rng, (8.0, 10.0), (5.0, 6.0), (3.2, 3.6))
    floor = str(rng.choice(["checkers", "flagstone", "terrazzo"]))
    shell.build_shell(layout, Finish(floor, ("wall0", "wall0", "wall0", "wall0")))
    period_m = float(rng.uniform(0.9, 1.3))
    _windows(layout, period_m, rng)
    _shelves(layout, rng)
    _end_walls(layout, period_m, rng)
    step_m = float(rng.uniform(0.16, 0.24))
    length_m = layout.walls[NORTH].length_m - 3.2
    for y in (-0.9, 1.1)[: int(rng.integers(1, 3))]:
        layout.set_down(Piece.standing(_balustrade(length_m, step_m)), 0.0, y)
    shell.scatter(layout, rng, (pieces.plant, pieces.seat), int(rng.integers(1, 3)))
    shell.hang_lamps(layout, (5, 2), 0.5)
    return layout


def _places(length_m: float, period_m: float) -> FloatArray:
    """Places along a wall, evenly about its middle."""
    count = int(length_m / period_m)
    return np.asarray(period_m * (np.arange(count) - (count - 1) / 2), np.float64)


def _windows(layout: Layout, period_m: float, rng: np.random.Generator) -> None:
    """Equal windows above tiles, with a radiator below each and a vase beside some."""
    wall = layout.walls[NORTH]
    reach = wall.length_m / 2
    shell.clad(layout, NORTH, (-reach, reach, 0.09, _TILED_M), "subway")
    for s in _places(wall.length_m - 0.4, period_m):
        size = (0.6 * period_m, 1.2)
        shell.add_window(layout, NORTH, (float(s), _SILL_M), size, panes=1)
        radiator = Piece.standing(props.radiator(0.5 * period_m, 0.45))
        layout.stand(radiator, NORTH, float(s))
        if rng.random() < 0.5:
            vase = props.vase(float(rng.uniform(0.2, 0.35)), str(rng.choice(["glaze", "clay"])))
            at = (float(s + rng.uniform(-0.15, 0.15)), 0.5)
            layout.parts += shell.on_wall(layout, NORTH, placed([vase], 0.0, -0.1), *at)


def _shelves(layout: Layout, rng: np.random.Generator) -> None:
    """Bookcases with the very same books along a wall, each with a picture of its own."""
    wall, books = layout.walls[SOUTH], int(rng.integers(1 << 31))
    width, depth, height = _SHELVES_M
    for j, s in enumerate(_places(wall.length_m, width + 0.02)):
        case = bookcase(np.random.default_rng(books), _SHELVES_M, "oak", "books0")
        artwork = props.framed_artwork(0.3, 0.24, f"picture{j + 11}", "brass")
        at = (float(rng.uniform(-0.3, 0.3)), -depth / 2, float(rng.uniform(0.4, height - 0.3)))
        layout.stand(Piece.standing(case + placed(artwork, *at)), SOUTH, float(s))


def _end_walls(layout: Layout, period_m: float, rng: np.random.Generator) -> None:
    """Prints of one artwork in two rows, a quarter of them of another."""
    for k, (artwork, frame) in ((EAST, ("picture", "black")), (WEST, ("poster", "oak"))):
        for j, s in enumerate(_places(layout.walls[k].length_m - 0.2, 0.7 * period_m)):
            for z in (1.1, 2.0):
                name = f"{artwork}{j + 1 if rng.random() < 0.25 else 0}"
                layout.hang(shell.framed(name, (0.42, 0.56), frame), k, float(s), z)


def _balustrade(length_m: float, step_m: float) -> list[Part]:
    """Turned balusters between two rails, its middle at the origin."""
    parts = box((length_m, 0.14, 0.08), (0.0, 0.0, 0.0), "oak", skip="-z")
    parts += box((length_m, 0.1, 0.06), (0.0, 0.0, _RAIL_M - 0.06), "oak")
    baluster = lathe(_BALUSTER, "white", sides=10)
    for x in _places(length_m, step_m):
        parts += placed([baluster], float(x), 0.0, 0.08)
    return parts
