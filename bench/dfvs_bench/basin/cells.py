"""How far from the goal a trial of the basin starts: translation by axis, and rotation."""

import math
from dataclasses import dataclass

import numpy as np

from dfvs_core.errors import ConfigError
from dfvs_core.geometry.arrays import FloatArray
from dfvs_core.geometry.poses import make_pose, so3_exp

TRANSLATIONS_M = tuple(round(0.4 * k, 1) for k in range(1, 11))
"""The paper's, along its Fig. 6's axis: 0.4 to 4 m."""

ROTATIONS_DEG = ((10.0, 10.0, 25.0), (20.0, 20.0, 40.0), (30.0, 30.0, 50.0))
"""The paper's three sets, about the camera's x, y and z."""

_MOST_M, _MOST_DEG = 100.0, 180.0


@dataclass(frozen=True, slots=True)
class Cell:
    """A point of Fig. 6.

    Raises
    ------
    ConfigError
        If a number is out of range.
    """

    translation_m: float
    """The largest of the displacements along the goal camera's three axes."""
    rotation_deg: tuple[float, float, float]
    """About the camera's x, y and z, degrees; the sign of each is drawn."""

    def __post_init__(self) -> None:
        """Refuse what is no displacement."""
        if not 0 < self.translation_m <= _MOST_M:
            raise ConfigError(f"a translation is {self.translation_m:g} m", "above 0, to 100 m")
        if not all(0 <= angle <= _MOST_DEG for angle in self.rotation_deg):
            raise ConfigError(f"a rotation is {self.rotation_deg} degrees", "each 0 to 180")

    @property
    def name(self) -> str:
        """Part of the names of its trials: ``r20-20-40-t1.2``."""
        return f"r{'-'.join(f'{a:g}' for a in self.rotation_deg)}-t{self.translation_m:g}"

    @property
    def seed(self) -> tuple[int, ...]:
        """What sets its random numbers apart from those of other cells."""
        return tuple(round(1000 * value) for value in (self.translation_m, *self.rotation_deg))

    def displacement(self, rng: np.random.Generator) -> FloatArray:
        """Draw ``T_goal_start`` (4, 4): a start as the goal camera sees it.

        One axis, drawn, has the whole translation, the others any share of it: a point on the
        surface of a cube. The paper displaces all three axes alike, which no room is high enough
        for beyond a metre.
        """
        offset_m = self.translation_m * rng.uniform(-1.0, 1.0, 3)
        offset_m[rng.integers(3)] = self.translation_m * rng.choice([-1.0, 1.0])
        signs = rng.choice([-1.0, 1.0], 3)
        turns = [
            so3_exp(sign * math.radians(angle) * axis)
            for sign, angle, axis in zip(signs, self.rotation_deg, np.eye(3), strict=True)
        ]
        return make_pose(turns[0] @ turns[1] @ turns[2], offset_m)
