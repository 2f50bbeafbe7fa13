"""Thinned path of the vehicle, of bounded size."""

import math

_SPACING_M = 0.05
_MOST_POINTS = 1000

Position = tuple[float, float, float]


class FlownPath:
    """Positions (m) at least so far apart; when they become too many, every second one goes."""

    def __init__(self) -> None:
        self._spacing_m = _SPACING_M
        self.positions_m: list[Position] = []

    def add(self, position_m: Position) -> bool:
        """Take a position; returns whether it is kept."""
        kept = self.positions_m
        if kept and math.dist(kept[-1], position_m) < self._spacing_m:
            return False
        kept.append(position_m)
        if len(kept) > _MOST_POINTS:
            self.positions_m = kept[::2]
            self._spacing_m *= 2.0
        return True
