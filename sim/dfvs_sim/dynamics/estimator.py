"""The autopilot's state estimate: the true motion plus the errors of ``EstimateErrors``."""

from collections.abc import Sequence
from dataclasses import dataclass, fields

import numpy as np

from dfvs_core.geometry.poses import wrap_angle
from dfvs_sim.dynamics.estimate_errors import ErrorProcess, EstimateErrors
from dfvs_sim.dynamics.motion_state import MotionState
from dfvs_sim.dynamics.rigid_body import Quadrotor

_VELOCITY_RECOVERY_S = 1.0
"""Time constant with which the estimate comes back from a wrong velocity."""


_FIELDS = tuple(field.name for field in fields(MotionState))


@dataclass(slots=True)
class Estimate(MotionState):
    """Estimated motion."""

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
        for name in _FIELDS:
            setattr(e, name, getattr(vehicle, name))
        self._add(self._position, self._velocity)
        if self._process is not None:
            self._process.step(dt_s)
            error = self._process
            self._add(error.position_m, error.velocity_m_s)
            e.a_north_m_s2 += error.acceleration_m_s2[0]
            e.a_east_m_s2 += error.acceleration_m_s2[1]
            e.roll_rad += error.attitude_rad[0]
            e.pitch_rad += error.attitude_rad[1]
        if self._process is not None or self._yaw != 0.0:
            yaw = vehicle.yaw_rad + self.attitude_error_rad[2]
            e.yaw_rad = wrap_angle(yaw)
        return e

    def _add(self, position_m: Sequence[float], velocity_m_s: Sequence[float]) -> None:
        """Add errors of position and velocity."""
        e = self.estimate
        e.north_m += position_m[0]
        e.east_m += position_m[1]
        e.down_m += position_m[2]
        e.v_north_m_s += velocity_m_s[0]
        e.v_east_m_s += velocity_m_s[1]
        e.v_down_m_s += velocity_m_s[2]
