"""All kinds of rooms that can be generated, by name."""

from dfvs_core.errors import ConfigError
from dfvs_rooms.generator.doorway import doorway_rooms
from dfvs_rooms.generator.interior import KINDS, drawn_interior
from dfvs_rooms.generator.room import Room
from dfvs_rooms.room_types.catalogue import PLACES, REPETITIVE_PLACES, drawn_place
from dfvs_rooms.room_types.living_room import living_room

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
        return drawn_place(seed, kind)
    return doorway_rooms(seed) if kind == TWO_ROOMS else drawn_interior(seed, kind)
