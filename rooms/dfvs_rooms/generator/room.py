"""A room: its parts, materials and openings to the sky, without light."""

from dataclasses import dataclass
from typing import Self

import numpy as np

from dfvs_core.geometry.arrays import FloatArray
from dfvs_rooms.generator.layout import Wall
from dfvs_rooms.generator.outdoors import Sky
from dfvs_rooms.generator.solids import Part
from dfvs_rooms.surfaces.materials import Material

OPENING_BEFORE_WALL_M = 0.07
"""Skylight of a window on a wall shines from here, m: before its frame."""
_PANE_BEFORE_WALL_M = 0.002


@dataclass(frozen=True, slots=True)
class Opening:
    """A rectangle of skylight that looks into the room, in room axes.

    Parameters
    ----------
    middle_m : tuple of float
        Its middle (3,), m.
    turn_deg : float
        Turn of the wall that it is in, as of things that stand against it; 0 is the north wall.
    size_m : tuple of float
        Width and height, m.
    before_pane_m : float
        How far it stands before the pane, m: points of light that stand for it shine past the frame
        from there, but as a surface it would hide the frame.
    """

    middle_m: tuple[float, float, float]
    turn_deg: float
    size_m: tuple[float, float]
    before_pane_m: float = 0.0

    @classmethod
    def on_wall(cls, wall: Wall, place_m: tuple[float, float], size_m: tuple[float, float]) -> Self:
        """Skylight just before a wall, at place (along the wall, height), m."""
        c, s = np.cos(np.radians(wall.turn_deg)), np.sin(np.radians(wall.turn_deg))
        along, out = place_m[0], wall.distance_m - OPENING_BEFORE_WALL_M
        middle = (float(c * along - s * out), float(s * along + c * out), place_m[1])
        return cls(middle, wall.turn_deg, size_m, OPENING_BEFORE_WALL_M - _PANE_BEFORE_WALL_M)

    @property
    def pane_middle(self) -> FloatArray:
        """Middle (3,) of the pane, m."""
        return np.array(self.middle_m) - self.before_pane_m * self.inwards

    @property
    def inwards(self) -> FloatArray:
        """Unit vector (3,) into the room."""
        turn = np.radians(self.turn_deg)
        return np.array([np.sin(turn), -np.cos(turn), 0.0])

    @property
    def across(self) -> FloatArray:
        """Unit vector (3,) along the wall."""
        turn = np.radians(self.turn_deg)
        return np.array([np.cos(turn), np.sin(turn), 0.0])


@dataclass(frozen=True, slots=True)
class Room:
    """Parts of a room in room axes, and their materials by name.

    ``walls`` are the materials whose light sets the exposure (all, where it is empty); ``sky`` is
    the daylight over what has no roof.
    """

    parts: tuple[Part, ...]
    materials: dict[str, Material]
    walls: frozenset[str] = frozenset()
    openings: tuple[Opening, ...] = ()
    sky: Sky | None = None
