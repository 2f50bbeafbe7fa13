"""All places by name, and how one is made from a seed."""

from collections.abc import Callable

import numpy as np

from dfvs_rooms.fittings.natural import WALLS, natural_materials
from dfvs_rooms.fittings.shell import Place
from dfvs_rooms.generator.room import Room
from dfvs_rooms.generator.solids import joined
from dfvs_rooms.room_types.arcade import arcade
from dfvs_rooms.room_types.bedroom import bedroom
from dfvs_rooms.room_types.canteen import canteen
from dfvs_rooms.room_types.courtyard import courtyard
from dfvs_rooms.room_types.gallery import gallery
from dfvs_rooms.room_types.kitchen import kitchen
from dfvs_rooms.room_types.library import library
from dfvs_rooms.room_types.office import office
from dfvs_rooms.room_types.passage import passage
from dfvs_rooms.room_types.workshop import workshop
from dfvs_rooms.surfaces.materials import kind_of

PLACES: dict[str, Callable[[np.random.Generator], Place]] = {
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

REPETITIVE_PLACES: dict[str, Callable[[np.random.Generator], Place]] = {"arcade": arcade}
"""Places of repeated structures, to test matches in; drawn by name alone."""


def drawn_place(seed: int, kind: str) -> Room:
    """Make a place, without light; the seed alone decides.

    Raises
    ------
    KeyError
        If there is no such place.
    """
    shape, looks = np.random.default_rng([seed, 5]).spawn(2)
    place = (PLACES | REPETITIVE_PLACES)[kind](shape)
    parts = joined(place.layout.parts)
    names = {part.material for part in parts}
    walls = frozenset(name for name in names if kind_of(name) in WALLS)
    materials = natural_materials(names, looks)
    return Room(tuple(parts), materials, walls, place.openings, place.sky)
