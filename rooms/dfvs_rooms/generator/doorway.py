"""Two rooms with a doorway between them: what lies round the corner is out of sight."""

import numpy as np

from dfvs_rooms.generator import interior_furniture as pieces
from dfvs_rooms.generator.interior import Kind, draw_layout, painted
from dfvs_rooms.generator.room import Room
from dfvs_rooms.generator.solids import Part, box, placed

LENGTH_M, WIDTH_M, HEIGHT_M = 7.6, 3.9, 2.7
DOOR_WIDTH_M, DOOR_HEIGHT_M, THICKNESS_M = 1.5, 2.1, 0.14

_KIND = Kind(
    (LENGTH_M, LENGTH_M),
    (WIDTH_M, WIDTH_M),
    (HEIGHT_M, HEIGHT_M),
    (pieces.bookcase, pieces.sideboard, pieces.plant, pieces.desk, pieces.radiator, pieces.cartons),
    (),
    (0.45, 0.45),
    (0, 0),
    1.0,
)
_ARTWORK_HEIGHT_M = 1.45
_OFF_WALL_M = 0.002


def doorway_rooms(seed: int) -> Room:
    """Two furnished rooms, west and east of a wall with a doorway in its middle."""
    shape, looks = np.random.default_rng([seed, 2]).spawn(2)
    layout = draw_layout(_KIND, shape)
    layout.parts += _partition(shape)
    return painted(layout, looks)


def _partition(rng: np.random.Generator) -> list[Part]:
    """Wall across the room at x = 0 with a doorway, and an artwork on each of its four faces."""
    side_m = 0.5 * (WIDTH_M - DOOR_WIDTH_M)
    middle_m = 0.5 * (DOOR_WIDTH_M + side_m)
    parts: list[Part] = []
    for y in (-middle_m, middle_m):
        parts += box((THICKNESS_M, side_m, HEIGHT_M), (0.0, y, 0.0), "wall0", skip="-z +z")
        for face in (-1.0, 1.0):
            x = face * (0.5 * THICKNESS_M + _OFF_WALL_M)
            parts += placed(pieces.artwork(rng).parts, x, y, _ARTWORK_HEIGHT_M, 90.0 * face)
    over = (THICKNESS_M, DOOR_WIDTH_M, HEIGHT_M - DOOR_HEIGHT_M)
    return parts + box(over, (0.0, 0.0, DOOR_HEIGHT_M), "wall0", skip="+z -y +y")
