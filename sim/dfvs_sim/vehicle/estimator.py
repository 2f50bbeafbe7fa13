"""What the autopilot believes about its motion: the truth plus errors of chosen size."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from dfvs_sim.vehicle.dynamics import Quadrotor

_BLOCK = 4096
_DRIFT_TIME_S = 20.0


@dataclass(frozen=True, slots=True)
class EstimatorErrors:
    """Standard deviations: white noise on velocity, slow wander of position."""

    velocity_m_s: float = 0.0
    position_m: float = 0.0


@dataclass(slots=True)
class Estimate:
    """Estimated motion in NED; the same names as in ``Quadrotor``."""

    north_m: float = 0.0
    east_m: float = 0.0
    down_m: float = 0.0
    v_north_m_s: float = 0.0
    v_east_m_s: float = 0.0
    v_down_m_s: float = 0.0
    a_north_m_s2: float = 0.0
    a_east_m_s2: float = 0.0
    a_down_m_s2: float = 0.0
    roll_rad: float = 0.0
    pitch_rad: float = 0.0
    yaw_rad: float = 0.0
    roll_rate_rad_s: float = 0.0
    pitch_rate_rad_s: float = 0.0
    yaw_rate_rad_s: float = 0.0
    on_ground: bool = True
    valid: bool = True
    resets: int = 0


class Estimator:
    """Follows the vehicle; wanders, jitters and jumps as told."""

    def __init__(self, errors: EstimatorErrors, rng: np.random.Generator) -> None:
        self._errors = errors
        self._rng = rng
        self._normals: list[float] = []
        self._drift = [0.0, 0.0, 0.0]
        self._jumps = [0.0, 0.0, 0.0]
        self.estimate = Estimate()

    def jump(self, north_m: float, east_m: float, down_m: float) -> None:
        """Shift the position estimate at once, as after a wrong fix."""
        for i, shift in enumerate((north_m, east_m, down_m)):
            self._jumps[i] += shift
        self.estimate.resets += 1

    def update(self, dt_s: float, vehicle: Quadrotor) -> Estimate:
        """Estimate for this step; the returned object is the same each time."""
        e = self.estimate
        self._wander(dt_s)
        e.north_m = vehicle.north_m + self._drift[0] + self._jumps[0]
        e.east_m = vehicle.east_m + self._drift[1] + self._jumps[1]
        e.down_m = vehicle.down_m + self._drift[2] + self._jumps[2]
        noise = self._errors.velocity_m_s
        e.v_north_m_s = vehicle.v_north_m_s + noise * self._normal()
        e.v_east_m_s = vehicle.v_east_m_s + noise * self._normal()
        e.v_down_m_s = vehicle.v_down_m_s + noise * self._normal()
        e.a_north_m_s2, e.a_east_m_s2 = vehicle.a_north_m_s2, vehicle.a_east_m_s2
        e.a_down_m_s2 = vehicle.a_down_m_s2
        e.roll_rad, e.pitch_rad, e.yaw_rad = vehicle.roll_rad, vehicle.pitch_rad, vehicle.yaw_rad
        e.roll_rate_rad_s, e.pitch_rate_rad_s = vehicle.roll_rate_rad_s, vehicle.pitch_rate_rad_s
        e.yaw_rate_rad_s = vehicle.yaw_rate_rad_s
        e.on_ground = vehicle.on_ground
        return e

    def _wander(self, dt_s: float) -> None:
        """Advance the position error (an Ornstein-Uhlenbeck process)."""
        sigma = self._errors.position_m
        if sigma == 0.0:
            return
        kick = sigma * math.sqrt(2.0 * dt_s / _DRIFT_TIME_S)
        for i in range(3):
            self._drift[i] += kick * self._normal() - self._drift[i] * dt_s / _DRIFT_TIME_S

    def _normal(self) -> float:
        """Standard normal number, drawn in blocks: one call a step would cost too much."""
        if self._errors.velocity_m_s == 0.0 and self._errors.position_m == 0.0:
            return 0.0
        if not self._normals:
            self._normals = self._rng.standard_normal(_BLOCK).tolist()
        return self._normals.pop()
