"""All kinds of rooms that can be generated, by name."""

from collections.abc import Callable

import numpy as np

from dfvs_core.errors import ConfigError
from dfvs_rooms.fittings.natural import WALLS, natural_materials
from dfvs_rooms.generator.doorway import doorway_rooms
from dfvs_rooms.generator.interior import KINDS, drawn_interior
from dfvs_rooms.generator.layout import Layout
from dfvs_rooms.generator.room import Room
from dfvs_rooms.generator.solids import joined
from dfvs_rooms.room_types.arcade import arcade
from dfvs_rooms.room_types.bedroom import bedroom
from dfvs_rooms.room_types.canteen import canteen
from dfvs_rooms.room_types.courtyard import courtyard
from dfvs_rooms.room_types.gallery import gallery
from dfvs_rooms.room_types.kitchen import kitchen
from dfvs_rooms.room_types.library import library
from dfvs_rooms.room_types.living_room import living_room
from dfvs_rooms.room_types.office import office
from dfvs_rooms.room_types.passage import passage
from dfvs_rooms.room_types.workshop import workshop
from dfvs_rooms.surfaces.materials import kind_of

PLACES: dict[str, Callable[[np.random.Generator], Layout]] = {
    "kitchen": kitchen,
    "bedroom": bedroom,
    "workshop": workshop,
    "library": library,
    "gallery": gallery,
    "office": office,
    "passage": passage,
    "canteen": canteen,
    "courtyard": courtyard,
}
"""Furnishers of the places by name."""

REPETITIVE_PLACES: dict[str, Callable[[np.random.Generator], Layout]] = {"arcade": arcade}
"""Places of repeated structures, to test matches in; drawn by name alone."""

LIVING_ROOM = "living-room"
TWO_ROOMS = "two-rooms"
ROOM_KINDS = (LIVING_ROOM, TWO_ROOMS, *sorted(KINDS), *sorted(PLACES))
"""Kinds that are drawn where all kinds are asked for."""
REPETITIVE_KINDS = tuple(sorted(REPETITIVE_PLACES))
"""Kinds of repeated structures, drawn where they are named."""


def room_of_kind(kind: str, seed: int) -> Room:
    """Make a room of a kind, without light; the seed alone decides.

    Raises
    ------
    ConfigError
        If there is no such kind.
    """
    kinds = ROOM_KINDS + REPETITIVE_KINDS
    if kind not in kinds:
        raise ConfigError(f"no kind of room {kind!r}", f"one of {', '.join(kinds)}")
    if kind == LIVING_ROOM:
        return living_room(seed)
    if kind in PLACES or kind in REPETITIVE_PLACES:
        return _drawn_place(seed, kind)
    return doorway_rooms(seed) if kind == TWO_ROOMS else drawn_interior(seed, kind)


def _drawn_place(seed: int, kind: str) -> Room:
    shape, looks = np.random.default_rng([seed, 5]).spawn(2)
    layout = (PLACES | REPETITIVE_PLACES)[kind](shape)
    parts = joined(layout.parts)
    names = {part.material for part in parts}
    walls = frozenset(name for name in names if kind_of(name) in WALLS)
    materials = natural_materials(names, looks)
    return Room(tuple(parts), materials, walls, tuple(layout.openings), layout.sky)
