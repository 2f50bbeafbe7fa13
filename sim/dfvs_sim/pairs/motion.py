"""How far and how much a camera moves between the two views of a pair."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from dfvs_core.arrays import FloatArray
from dfvs_core.matching.evaluation import LEVELS
from dfvs_core.pair_files import FARTHEST_DEPTH_M, LARGEST_REACH, MEDIUM_SHARE, SMALL_SHARE

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


def training_motion(rng: np.random.Generator, depth_m: float) -> Motion:
    """Motion of a training pair, in a view of a median depth.

    Three in twenty are small (log-uniform, up to 0.25 m and 8 degrees), a quarter reaches 0.5 m and
    15 degrees, the others 0.8 times the depth and 35, 35 and 55 degrees.
    """
    kind = rng.random()
    turn = rng.uniform(-1.0, 1.0, 3)
    if kind < SMALL_SHARE:
        distance = math.exp(rng.uniform(math.log(0.004), math.log(0.25)))
        return Motion(distance, turn * math.radians(math.exp(rng.uniform(-1.6, math.log(8.0)))))
    if kind < SMALL_SHARE + MEDIUM_SHARE:
        return Motion(float(rng.uniform(0.0, 0.5)), turn * math.radians(15.0))
    distance = float(rng.uniform(0.0, LARGEST_REACH)) * min(depth_m, FARTHEST_DEPTH_M)
    return Motion(distance, turn * np.radians([35.0, 35.0, 55.0]))


def evaluation_motion(rng: np.random.Generator, level: str) -> Motion:
    """Motion of a level: 0.4 to 1 times its distance, up to its angle about each axis."""
    if level not in LEVELS:
        raise KeyError(level)
    distance_m, angle_deg = _LEVEL_LIMITS[level]
    turn = rng.uniform(-1.0, 1.0, 3) * math.radians(angle_deg)
    return Motion(distance_m * float(rng.uniform(0.4, 1.0)), turn)
