"""Wind on the vehicle: a steady part and gusts, with named grades.

Gusts are Dryden's longitudinal turbulence near the ground (MIL-F-8785C): a first-order
Gauss-Markov velocity along each horizontal axis.
"""

import enum
import math
from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np

from dfvs_sim.dynamics.gauss_markov import FirstOrder, normal_source


class WindGrade(enum.Enum):
    """How strong the wind is; the value is the name on the command line."""

    CALM = "calm"
    BREEZE = "breeze"
    WINDY = "windy"


@dataclass(frozen=True, slots=True)
class WindStrength:
    """Speed of the steady part, deviation of the gusts on each axis, their correlation time."""

    steady_m_s: float = 0.0
    gust_m_s: float = 0.0
    gust_time_s: float = 1.0


STRENGTHS: Mapping[WindGrade, WindStrength] = {
    WindGrade.CALM: WindStrength(),
    WindGrade.BREEZE: WindStrength(steady_m_s=1.0, gust_m_s=0.2, gust_time_s=15.5),
    WindGrade.WINDY: WindStrength(steady_m_s=3.0, gust_m_s=0.6, gust_time_s=5.2),
}
"""Gusts of 0.2 of the steady wind, over the 15.5 m that turbulence measures 2 m above ground."""


class Wind:
    """Velocity of the air in NED (m/s), horizontal; advanced by ``step``.

    A steady wind from a direction that ``rng`` draws, gusts, and further steady wind towards north
    and east.
    """

    def __init__(
        self, strength: WindStrength, north_m_s: float, east_m_s: float, rng: np.random.Generator
    ) -> None:
        self._steady = north_m_s, east_m_s
        self._gusts: tuple[FirstOrder, FirstOrder] | None = None
        if strength != WindStrength():
            bearing = float(rng.uniform(-math.pi, math.pi))
            north = north_m_s + strength.steady_m_s * math.cos(bearing)
            self._steady = north, east_m_s + strength.steady_m_s * math.sin(bearing)
            normal = normal_source(rng)
            sd, time_s = strength.gust_m_s, strength.gust_time_s
            self._gusts = FirstOrder(sd, time_s, normal), FirstOrder(sd, time_s, normal)

    def step(self, dt_s: float) -> tuple[float, float]:
        """Advance by ``dt_s``; returns the wind towards north and east."""
        if self._gusts is None:
            return self._steady
        north, east = self._gusts
        return self._steady[0] + north.step(dt_s), self._steady[1] + east.step(dt_s)
