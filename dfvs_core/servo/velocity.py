"""Velocity from the wanted motion: adaptive gain, latency and speed limits."""

import math
from dataclasses import dataclass

import numpy as np

from dfvs_core.geometry.arrays import FloatArray
from dfvs_core.servo.config import ServoConfig


def velocity_for(
    motion: FloatArray, velocity: FloatArray, late_s: FloatArray, config: ServoConfig
) -> FloatArray:
    """Velocity (d,): what will be left of the motion once the vehicle answers, times the gain.

    The gain grows as the error vanishes: a large error saturates anyway, a small one would
    otherwise take for ever.

    Parameters
    ----------
    motion : (d,)
        From the pictured place to the goal, m and rad.
    velocity : (d,)
        How the vehicle moves, m/s and rad/s.
    late_s : (d,)
        Age of the image and the time until a velocity is followed, s.
    config : ServoConfig
        Gains, and the error (m + rad) between them.
    """
    nearness = math.exp(-float(np.linalg.norm(motion)) / config.gain_error)
    gain = config.gain_far + (config.gain_near - config.gain_far) * nearness
    return gain * (motion - velocity * late_s)


@dataclass(frozen=True, slots=True)
class SpeedLimit:
    """A limit on the length of some components of a velocity."""

    components: tuple[int, ...]
    limit: float


def saturate(velocity: FloatArray, limits: tuple[SpeedLimit, ...]) -> FloatArray:
    """Scale all components by one factor, so that every limit holds and the path stays.

    Parameters
    ----------
    velocity : (d,)
        m/s and rad/s.
    """
    factor = 1.0
    for group in limits:
        length = float(np.linalg.norm(velocity[list(group.components)]))
        if length > group.limit:
            factor = min(factor, group.limit / length)
    return velocity * factor
