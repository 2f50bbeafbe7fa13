"""The autopilot's state estimate: the true motion plus the errors of ``EstimateErrors``."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from dfvs_sim.dynamics.estimate_errors import ErrorProcess, EstimateErrors
from dfvs_sim.dynamics.rigid_body import Quadrotor

_VELOCITY_RECOVERY_S = 1.0
"""Time constant with which the estimate comes back from a wrong velocity."""


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
    """Follows the vehicle with errors.

    Parameters
    ----------
    errors : EstimateErrors
        Sizes of the errors; ``EstimateErrors()`` for none.
    rng : numpy.random.Generator
        Source of the errors.
    """

    def __init__(self, errors: EstimateErrors, rng: np.random.Generator) -> None:
        self._process = None if errors.none else ErrorProcess(errors, rng)
        self._position = [0.0, 0.0, 0.0]
        self._velocity = [0.0, 0.0, 0.0]
        self._yaw = 0.0
        self.estimate = Estimate()

    @property
    def attitude_error_rad(self) -> tuple[float, float, float]:
        """Estimated minus true roll, pitch and yaw."""
        if self._process is None:
            return 0.0, 0.0, self._yaw
        roll, pitch, yaw = self._process.attitude_rad
        return roll, pitch, yaw + self._yaw

    def reset_position(self, north_m: float, east_m: float, down_m: float) -> None:
        """Shift the position estimate at once, for good, as after a wrong fix."""
        for i, shift in enumerate((north_m, east_m, down_m)):
            self._position[i] += shift
        self.estimate.resets += 1

    def reset_velocity(self, north_m_s: float, east_m_s: float, down_m_s: float) -> None:
        """Shift the velocity estimate at once; it comes back within seconds."""
        for i, shift in enumerate((north_m_s, east_m_s, down_m_s)):
            self._velocity[i] += shift
        self.estimate.resets += 1

    def reset_heading(self, shift_rad: float) -> None:
        """Turn the heading estimate at once, for good."""
        self._yaw += shift_rad
        self.estimate.resets += 1

    def update(self, dt_s: float, vehicle: Quadrotor) -> Estimate:
        """Estimate for this step; the returned object is the same each time."""
        e = self.estimate
        if any(self._velocity):
            left = 1.0 - dt_s / _VELOCITY_RECOVERY_S
            self._velocity = [left * v for v in self._velocity]
        position, velocity = self._position, self._velocity
        e.north_m = vehicle.north_m + position[0]
        e.east_m = vehicle.east_m + position[1]
        e.down_m = vehicle.down_m + position[2]
        e.v_north_m_s = vehicle.v_north_m_s + velocity[0]
        e.v_east_m_s = vehicle.v_east_m_s + velocity[1]
        e.v_down_m_s = vehicle.v_down_m_s + velocity[2]
        e.a_north_m_s2, e.a_east_m_s2 = vehicle.a_north_m_s2, vehicle.a_east_m_s2
        e.a_down_m_s2 = vehicle.a_down_m_s2
        e.roll_rad, e.pitch_rad, e.yaw_rad = vehicle.roll_rad, vehicle.pitch_rad, vehicle.yaw_rad
        e.roll_rate_rad_s, e.pitch_rate_rad_s = vehicle.roll_rate_rad_s, vehicle.pitch_rate_rad_s
        e.yaw_rate_rad_s = vehicle.yaw_rate_rad_s
        e.on_ground = vehicle.on_ground
        if self._process is not None:
            self._process.step(dt_s)
            self._add(self._process)
        if self._process is not None or self._yaw != 0.0:
            yaw = vehicle.yaw_rad + self.attitude_error_rad[2]
            e.yaw_rad = (yaw + math.pi) % (2.0 * math.pi) - math.pi
        return e

    def _add(self, error: ErrorProcess) -> None:
        """Add the present errors; those of the heading are added with its resets."""
        e = self.estimate
        position, velocity = error.position_m, error.velocity_m_s
        e.north_m += position[0]
        e.east_m += position[1]
        e.down_m += position[2]
        e.v_north_m_s += velocity[0]
        e.v_east_m_s += velocity[1]
        e.v_down_m_s += velocity[2]
        e.a_north_m_s2 += error.acceleration_m_s2[0]
        e.a_east_m_s2 += error.acceleration_m_s2[1]
        e.roll_rad += error.attitude_rad[0]
        e.pitch_rad += error.attitude_rad[1]
