"""How far and how much a camera moves between the two views of a pair."""

import math
from dataclasses import dataclass

import numpy as np

from dfvs_core.geometry.arrays import FloatArray
from dfvs_models.evaluation import LEVELS

_LEVEL_LIMITS = {"small": (0.15, 6.0), "medium": (0.5, 15.0), "large": (1.2, 30.0)}


@dataclass(frozen=True, slots=True)
class Motion:
    """A camera's motion.

    Parameters
    ----------
    distance_m : float
        Way of the camera's centre, in whatever direction, m.
    turn_rad : (3,)
        Rotation vector about the camera's axes, rad.
    """

    distance_m: float
    turn_rad: FloatArray


def evaluation_motion(rng: np.random.Generator, level: str) -> Motion:
    """Motion of a level: 0.4 to 1 times its distance, up to its angle about each axis."""
    if level not in LEVELS:
        raise KeyError(level)
    distance_m, angle_deg = _LEVEL_LIMITS[level]
    turn = rng.uniform(-1.0, 1.0, 3) * math.radians(angle_deg)
    return Motion(distance_m * float(rng.uniform(0.4, 1.0)), turn)
