"""Finding places for things in a room: along a wall, on a wall, or free in the middle."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import TypeAlias

import numpy as np

from dfvs_rooms.generator.room import Opening, Sky
from dfvs_rooms.generator.solids import Part, placed

_TRIES = 12
_GAP_M, _OFF_WALL_M = 0.04, 0.002
_Area: TypeAlias = tuple[float, float, float, float]
"""Rectangle (left, low, right, high), m."""
_OPENING_BEFORE_WALL_M, _PANE_BEFORE_WALL_M = 0.07, 0.002
"""Skylight of a window on a wall shines from before its frame; its pane is behind it."""


@dataclass(frozen=True, slots=True)
class Piece:
    """A thing with its front to -y; its foot's middle (its back's, if it hangs) at the origin."""

    parts: tuple[Part, ...]
    width_m: float
    depth_m: float
    height_m: float
    """Its extent along x, y and z, m; of what hangs, upwards from its middle."""

    @classmethod
    def standing(cls, parts: Sequence[Part]) -> Piece:
        """Put the middle of a thing's foot at the origin, and measure it."""
        points = np.concatenate([part.vertices for part in parts])
        low, high = points.min(axis=0), points.max(axis=0)
        middle = 0.5 * (low + high)
        width, depth, _ = (float(v) for v in high - low)
        moved = placed(parts, -float(middle[0]), -float(middle[1]))
        return cls(tuple(moved), width, depth, float(high[2]))

    @classmethod
    def hanging(cls, parts: Sequence[Part]) -> Piece:
        """Measure a thing that hangs about the origin; its height is that of its upper half."""
        points = np.concatenate([part.vertices for part in parts])
        half = np.abs(points).max(axis=0)
        return cls(tuple(parts), 2 * float(half[0]), float(half[1]), float(half[2]))


@dataclass(frozen=True, slots=True)
class Wall:
    """One wall: its length, its distance from the room's middle, and how things on it turn."""

    length_m: float
    distance_m: float
    turn_deg: float

    def point(self, s: float, out: float) -> tuple[float, float]:
        """Place (x, y) of a point s along the wall and ``out`` from the room's middle."""
        c, n = np.cos(np.radians(self.turn_deg)), np.sin(np.radians(self.turn_deg))
        return float(c * s - n * out), float(n * s + c * out)


class Layout:
    """A room while it is being furnished, in places that ``rng`` draws.

    Its size is length (east-west), width (north-south) and height, m. ``openings`` are the windows
    that light it, ``sky`` is where it has no roof.
    """

    def __init__(self, size_m: tuple[float, float, float], rng: np.random.Generator) -> None:
        length, width, self.height_m = size_m
        self.half = np.array([length / 2, width / 2])
        self.walls = (
            Wall(length, width / 2, 0.0),
            Wall(width, length / 2, -90.0),
            Wall(length, width / 2, 180.0),
            Wall(width, length / 2, 90.0),
        )
        self.parts: list[Part] = []
        self.openings: list[Opening] = []
        self.sky: Sky | None = None
        self._rng = rng
        self._floor: list[_Area] = []
        self._on_walls: list[list[_Area]] = [[], [], [], []]

    def against_wall(self, piece: Piece) -> bool:
        """Stand a piece with its back against a wall; False if no place was found."""
        for _ in range(_TRIES):
            k = int(self._rng.integers(4))
            wall = self.walls[k]
            reach = wall.length_m / 2 - piece.width_m / 2 - _GAP_M
            if reach < 0:
                continue
            if self.stand(piece, k, float(self._rng.uniform(-reach, reach))):
                return True
        return False

    def stand(self, piece: Piece, k: int, s: float) -> bool:
        """Stand a piece against wall k, s along it from its middle; False where it cannot."""
        wall = self.walls[k]
        area = (s - piece.width_m / 2, 0.0, s + piece.width_m / 2, piece.height_m)
        out = wall.distance_m - piece.depth_m / 2 - _OFF_WALL_M
        x, y = wall.point(s, out)
        size = (piece.width_m, piece.depth_m)
        footprint = _around(x, y, size if k % 2 == 0 else size[::-1])
        if _beyond(area, wall) or _meets(area, self._on_walls[k]) or _meets(footprint, self._floor):
            return False
        self._on_walls[k].append(area)
        self._floor.append(footprint)
        self.parts += placed(piece.parts, x, y, 0.0, wall.turn_deg)
        return True

    def on_wall(
        self, piece: Piece, heights_m: tuple[float, float], walls: tuple[int, ...] = (0, 1, 2, 3)
    ) -> tuple[int, float, float] | None:
        """Hang a piece, its middle at a height from a range; returns wall, place and height."""
        for _ in range(_TRIES):
            k = int(self._rng.choice(walls))
            wall = self.walls[k]
            reach = wall.length_m / 2 - piece.width_m / 2 - _GAP_M
            z = float(self._rng.uniform(*heights_m))
            low, high = z - piece.height_m, z + piece.height_m
            if reach < 0 or high > self.height_m - _GAP_M or low < -1e-6:
                continue
            s = float(self._rng.uniform(-reach, reach))
            if self.hang(piece, k, s, z):
                return k, s, z
        return None

    def hang(self, piece: Piece, k: int, s: float, z: float) -> bool:
        """Hang a piece on wall k, its middle at (s, z); False where it cannot."""
        area = (
            *(s - piece.width_m / 2, z - piece.height_m),
            *(s + piece.width_m / 2, z + piece.height_m),
        )
        wall = self.walls[k]
        if _beyond(area, wall) or _meets(area, self._on_walls[k]):
            return False
        self._on_walls[k].append(area)
        x, y = wall.point(s, wall.distance_m)
        self.parts += placed(piece.parts, x, y, z, wall.turn_deg)
        return True

    def let_in_light(
        self, k: int, place_m: tuple[float, float], size_m: tuple[float, float]
    ) -> None:
        """Let skylight in from a window on wall k, at place (along the wall, height), m."""
        wall = self.walls[k]
        x, y = wall.point(place_m[0], wall.distance_m - _OPENING_BEFORE_WALL_M)
        before_pane_m = _OPENING_BEFORE_WALL_M - _PANE_BEFORE_WALL_M
        self.openings.append(Opening((x, y, place_m[1]), wall.turn_deg, size_m, before_pane_m))

    def in_the_middle(self, piece: Piece, *, turned: bool = True) -> bool:
        """Stand a piece anywhere on the floor, turned anyhow; False if no place was found."""
        angle = float(self._rng.uniform(0.0, 360.0)) if turned else 0.0
        reach = float(np.hypot(piece.width_m, piece.depth_m)) if turned else 0.0
        size = (reach, reach) if turned else (piece.width_m, piece.depth_m)
        limit = self.half - np.array(size) / 2 - _GAP_M
        if (limit < 0).any():
            return False
        for _ in range(_TRIES):
            x, y = (float(v) for v in self._rng.uniform(-limit, limit))
            if self._put(piece, (x, y), size, angle):
                return True
        return False

    def set_down(self, piece: Piece, x: float, y: float, turn_deg: float = 0.0) -> bool:
        """Stand a piece with its middle at (x, y), turned; False where that is taken."""
        c, s = abs(np.cos(np.radians(turn_deg))), abs(np.sin(np.radians(turn_deg)))
        width, depth = piece.width_m, piece.depth_m
        size = (float(c * width + s * depth), float(s * width + c * depth))
        return self._put(piece, (x, y), size, turn_deg)

    def hang_lamps(self, lamp: Sequence[Part], columns: int, rows: int) -> None:
        """Hang copies of a lamp, its top at the origin, under the ceiling on a grid."""
        for x in evenly(2 * float(self.half[0]), columns):
            for y in evenly(2 * float(self.half[1]), rows):
                self.parts += placed(lamp, x, y, self.height_m)

    def _put(
        self, piece: Piece, place: tuple[float, float], size: tuple[float, float], turn_deg: float
    ) -> bool:
        footprint = _around(*place, size)
        if _meets(footprint, self._floor):
            return False
        self._floor.append(footprint)
        self.parts += placed(piece.parts, *place, 0.0, turn_deg)
        return True


def evenly(length_m: float, count: int) -> list[float]:
    """Middles of equal stretches of a length, about its middle."""
    return [length_m * ((j + 0.5) / count - 0.5) for j in range(count)]


def _around(x: float, y: float, size: tuple[float, float]) -> _Area:
    return x - size[0] / 2, y - size[1] / 2, x + size[0] / 2, y + size[1] / 2


def _beyond(area: _Area, wall: Wall) -> bool:
    """Tell whether an area reaches past a wall's ends."""
    return max(-area[0], area[2]) > wall.length_m / 2


def _meets(area: _Area, taken: list[_Area]) -> bool:
    """Tell whether an area overlaps one of those taken."""
    return any(
        area[0] < t[2] and t[0] < area[2] and area[1] < t[3] and t[1] < area[3] for t in taken
    )
