"""The autopilot's state estimate: the true motion plus the errors of ``EstimateErrors``."""

from dataclasses import dataclass, fields

import numpy as np

from dfvs_core.geometry.poses import wrap_angle
from dfvs_sim.dynamics.estimate_errors import ErrorProcess, EstimateErrors
from dfvs_sim.dynamics.heading_reset import HeadingReset
from dfvs_sim.dynamics.rigid_body import MotionState, Quadrotor, Vector

_FIELDS = tuple(field.name for field in fields(MotionState))


@dataclass(slots=True)
class Estimate(MotionState):
    """Estimated motion."""

    valid: bool = True
    resets: int = 0


class Estimator:
    """Follows the vehicle with errors of these sizes, drawn from ``rng``."""

    def __init__(self, errors: EstimateErrors, rng: np.random.Generator) -> None:
        self._process = None if errors == EstimateErrors() else ErrorProcess(errors, rng)
        self._heading_reset = HeadingReset(errors, rng)
        self._position = [0.0, 0.0, 0.0]
        self.heading_change_rad = 0.0
        """By how much a reset changed the heading in the last step; 0 where there was none."""
        self.estimate = Estimate()

    @property
    def attitude_error_rad(self) -> Vector:
        """Estimated minus true roll, pitch and yaw."""
        if self._process is None:
            return 0.0, 0.0, 0.0
        roll, pitch, yaw = self._process.attitude_rad
        return roll, pitch, yaw + self._heading_reset.error_rad

    def reset_position(self, north_m: float, east_m: float, down_m: float) -> None:
        """Shift the position estimate at once, for good, as after a wrong fix."""
        for i, shift in enumerate((north_m, east_m, down_m)):
            self._position[i] += shift
        self.estimate.resets += 1

    def update(self, dt_s: float, vehicle: Quadrotor) -> Estimate:
        """Estimate for this step; the returned object is the same each time."""
        e = self.estimate
        for name in _FIELDS:
            setattr(e, name, getattr(vehicle, name))
        e.north_m += self._position[0]
        e.east_m += self._position[1]
        e.down_m += self._position[2]
        if self._process is not None:
            error = self._process
            error.step(dt_s)
            e.north_m += error.position_m[0]
            e.east_m += error.position_m[1]
            e.down_m += error.position_m[2]
            e.v_north_m_s += error.velocity_m_s[0]
            e.v_east_m_s += error.velocity_m_s[1]
            e.v_down_m_s += error.velocity_m_s[2]
            e.a_north_m_s2 += error.acceleration_m_s2[0]
            e.a_east_m_s2 += error.acceleration_m_s2[1]
            e.roll_rad += error.attitude_rad[0]
            e.pitch_rad += error.attitude_rad[1]
            self._reset_heading(on_ground=vehicle.on_ground)
            e.yaw_rad = wrap_angle(e.yaw_rad + self.attitude_error_rad[2])
        return e

    def _reset_heading(self, *, on_ground: bool) -> None:
        """Reset the heading where its time has come, and count it."""
        change = self._heading_reset.update(self.estimate.down_m, on_ground=on_ground)
        self.heading_change_rad = change or 0.0
        if change is not None:
            self.estimate.resets += 1
