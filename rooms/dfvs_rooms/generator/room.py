"""A room without light: its parts, its materials, its openings and the sky over it."""

from dataclasses import dataclass

import numpy as np

from dfvs_core.geometry.arrays import FloatArray
from dfvs_rooms.generator.solids import Part
from dfvs_rooms.surfaces.materials import Material


@dataclass(frozen=True, slots=True)
class Opening:
    """A rectangle of skylight that looks into the room, in room axes."""

    middle_m: tuple[float, float, float]
    """Its middle (3,), m."""
    turn_deg: float
    """Turn of the wall that it is in, as of things that stand against it; 0 is the north wall."""
    size_m: tuple[float, float]
    """Width and height, m."""
    before_pane_m: float = 0.0
    """How far it stands before the pane, m: points of light that stand for it shine past the frame
    from there, but as a surface it would hide the frame.
    """

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
class Sky:
    """Sun and sky over a place without a roof, in room axes (z up)."""

    sun_azimuth_deg: float
    sun_height_deg: float
    """Above the horizon; the azimuth counts from east to north."""
    sun_irradiance: tuple[float, float, float] = (24.0, 21.5, 17.5)
    """Red, green and blue on a surface that faces the sun."""
    radiance: tuple[float, float, float] = (2.6, 3.1, 4.0)
    """Red, green and blue of the sky, everywhere the same."""

    @property
    def to_sun(self) -> FloatArray:
        """Unit vector (3,) to the sun."""
        azimuth, height = np.radians([self.sun_azimuth_deg, self.sun_height_deg])
        level = np.cos(height)
        return np.array([level * np.cos(azimuth), level * np.sin(azimuth), np.sin(height)])


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
